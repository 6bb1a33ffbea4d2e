"""Fig. 16: added mass and damping, roll, with and without constraints."""

from two_dof import compare


def main():
    compare("fig16", 1, 1, "roll")


if __name__ == "__main__":
    main()
