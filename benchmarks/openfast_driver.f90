! Runs OpenFAST's own SS_Radiation or SS_Excitation (v3.0) on a file and prints time, the input (velocity or elevation)
! and the six forces:  driver rad|exc STEM FREQUENCY DOF
program openfast_driver
  use NWTC_Library
  use SS_Radiation
  use SS_Radiation_Types
  use SS_Excitation
  use SS_Excitation_Types
  implicit none
  real(DbKi), parameter :: duration = 300.0d0, two_pi = 6.283185307179586d0
  real(DbKi) :: dt, w
  integer :: steps, dof
  character(1024) :: mode, stem, word

  call get_command_argument(1, mode)
  call get_command_argument(2, stem)
  call get_command_argument(3, word)
  read(word, *) w
  call get_command_argument(4, word)
  read(word, *) dof
  dt = min(0.02d0, 0.005d0 * two_pi / w)
  steps = nint(duration / dt)
  call NWTC_Init()
  if (mode == 'rad') call radiation()
  if (mode == 'exc') call excitation()

contains

  subroutine check(status, text)
    integer, intent(in) :: status
    character(*), intent(in) :: text
    if (status < AbortErrLev) return
    write(0, *) trim(text)
    stop 1
  end subroutine

  subroutine print_row(t, force)
    real(DbKi), intent(in) :: t
    real(ReKi), intent(in) :: force(:)
    if (t > duration - 60.0d0 - 2.0d0 * two_pi / w .and. t < duration - 60.0d0) &
      write(*, '(8es24.15)') t, cos(w * t), force(1:6)
  end subroutine

  subroutine radiation()
    type(SS_Rad_InitInputType) :: given
    type(SS_Rad_InitOutputType) :: made
    type(SS_Rad_ContinuousStateType) :: x
    type(SS_Rad_DiscreteStateType) :: xd
    type(SS_Rad_ConstraintStateType) :: z
    type(SS_Rad_OtherStateType) :: other
    type(SS_Rad_ParameterType) :: p
    type(SS_Rad_InputType) :: u, inputs(3)
    type(SS_Rad_OutputType) :: y
    type(SS_Rad_MiscVarType) :: m
    real(DbKi) :: times(3)
    integer :: n, j, status
    character(ErrMsgLen) :: text
    given%InputFile = stem
    given%NBody = 1
    allocate(given%enabledDOFs(6), given%PtfmRefztRot(1))
    given%enabledDOFs = 1
    given%PtfmRefztRot = 0
    call SS_Rad_Init(given, u, p, x, xd, z, other, y, m, dt, made, status, text)
    call check(status, text)
    do j = 1, 3
      call SS_Rad_CopyInput(u, inputs(j), MESH_NEWCOPY, status, text)
    end do
    do n = 0, steps - 1
      times = n * dt + dt * (/ 1, 0, -1 /)
      do j = 1, 3
        inputs(j)%dq = 0
        inputs(j)%dq(dof) = cos(w * times(j))
      end do
      call SS_Rad_CalcOutput(times(2), inputs(2), p, x, xd, z, other, y, m, status, text)
      call print_row(times(2), y%y)
      call SS_Rad_UpdateStates(times(2), n, inputs, times, p, x, xd, z, other, m, status, text)
      call check(status, text)
    end do
  end subroutine

  subroutine excitation()
    type(SS_Exc_InitInputType) :: given
    type(SS_Exc_InitOutputType) :: made
    type(SS_Exc_ContinuousStateType) :: x
    type(SS_Exc_DiscreteStateType) :: xd
    type(SS_Exc_ConstraintStateType) :: z
    type(SS_Exc_OtherStateType) :: other
    type(SS_Exc_ParameterType) :: p
    type(SS_Exc_InputType) :: u, inputs(1)
    type(SS_Exc_OutputType) :: y
    type(SS_Exc_MiscVarType) :: m
    integer :: n, status
    character(ErrMsgLen) :: text
    given%InputFile = stem
    given%NBody = 1
    given%WaveDir = 0
    given%NStepWave = steps
    allocate(given%PtfmRefztRot(1), given%WaveElev0(0:steps), given%WaveTime(0:steps))
    given%PtfmRefztRot = 0
    do n = 0, steps
      given%WaveTime(n) = n * dt
      given%WaveElev0(n) = cos(w * n * dt)
    end do
    call SS_Exc_Init(given, u, p, x, xd, z, other, y, m, dt, made, status, text)
    call check(status, text)
    do n = 0, steps - 1
      call SS_Exc_CalcOutput(n * dt, u, p, x, xd, z, other, y, m, status, text)
      call print_row(n * dt, y%y)
      call SS_Exc_UpdateStates(n * dt, n, inputs, (/ n * dt /), p, x, xd, z, other, m, status, text)
      call check(status, text)
    end do
  end subroutine
end program
