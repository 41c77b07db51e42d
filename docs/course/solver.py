"""The program `solver`, beside this file, as an engine: `dropspin conform solver:Solver`."""

import dropspin as ds


class Solver(ds.ProgramEngine):
    """Algorithms 1 and 2 of the lecture note, in another language."""

    name = "solver"  # in results
    program = ("solver",)  # or ("dotnet", "solver.dll"), ("python3", "solver_program.py")

    def declines(self, scene: ds.Scenario) -> str | None:
        """The note covers floors without friction and floors on which contacts do not slip."""
        if scene.floor is not None and not isinstance(scene.floor.friction, str):
            return "friction is 'none' or 'infinite'"
        return super().declines(scene)

    def discretisation(self, scene: ds.Scenario) -> str:
        """`conform` compares impacts with the law named here, eq 11 to 17 of the note."""
        return "semi-implicit Euler, law note"
