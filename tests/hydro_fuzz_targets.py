"""The files of coefficients that are damaged: one of each form, written by `hydro_samples`."""

import hydro_samples as samples
from fuzzing import Target, arrays_digest

import radiation_ss as rss

SMALL = samples.body_data(nw=3)
FIELDS = ("omega", "A", "B", "A_inf", "A_zero", "M", "C", "D", "X", "directions", "rho", "g", "depth",
          "reference_point", "dofs")


def digest(data):
    return arrays_digest(*(getattr(data, name) for name in FIELDS))


def _netcdf(folder):
    rss.write_hydro(SMALL, folder / "body.nc")
    return folder / "body.nc"


def _target(name, file, write, text=True):
    return Target(name, write, file, rss.read_hydro, digest, text)


def targets():
    """Return one target for each file of each form."""
    def sampled(writer):
        return lambda folder: writer(SMALL, folder)

    def run(folder):
        return samples.nemoh(SMALL, folder / "run")

    found = [_target(f"WAMIT {suffix}", f"body{suffix}", sampled(samples.wamit)) for suffix in (".1", ".3", ".hst")]
    found += [_target("WAMIT .out", "body.out", sampled(samples.wamit_out)),
              _target("AQWA .AH1", "body.AH1", sampled(samples.aqwa))]
    found += [_target(f"NEMOH {name}", f"run/{name}", run)
              for name in ("Nemoh.cal", "RadiationCoefficients.tec", "ExcitationForce.tec", "KH.dat", "Inertia.dat")]
    found += [_target(f"HAMS {name}", file, sampled(samples.hams)) for name, file in (
        ("ControlFile.in", "Input/ControlFile.in"), ("Hydrostatic.in", "Input/Hydrostatic.in"),
        (".1", "Output/Wamit_format/body.1"))]
    found += [_target(f"HydroStar {name}", name, sampled(samples.hydrostar))
              for name in ("AddedMass_11.rao", "WaveDamping_35.rao", "Excitation_3.rao")]
    found += [_target("AQWA .LIS", "body.LIS", sampled(samples.aqwa_lis)),
              _target("OrcaFlex .yml", "body.yml", sampled(samples.orcaflex))]
    found += [_target("Capytaine .nc", "body.nc", _netcdf, False),
              _target("BEMIO .h5", "body.h5", sampled(samples.bemio), False),
              _target("MSS .mat", "body.mat", sampled(samples.mss), False)]
    return found
