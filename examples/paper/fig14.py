"""Fig. 14: added mass and damping, sway, with and without constraints."""

from two_dof import compare


def main():
    compare("fig14", 0, 0, "sway")


if __name__ == "__main__":
    main()
