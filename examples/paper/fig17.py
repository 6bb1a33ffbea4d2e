"""Fig. 17: wave-exciting forces in sway and roll with constraints at different frequencies."""

from two_dof import forces


def main():
    forces("fig17")


if __name__ == "__main__":
    main()
