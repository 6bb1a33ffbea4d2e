"""Fig. 15: added mass and damping, coupling, with and without constraints."""

from two_dof import compare


def main():
    compare("fig15", 0, 1, "coupling")


if __name__ == "__main__":
    main()
