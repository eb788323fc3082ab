"""``geodesic compile``."""

import typer


def compile_kernels() -> None:
    """Compile the kernels that are missing, in as many processes as there are cores."""
    import geodesic_core as gc

    gc.compile_kernels()
    typer.echo("All kernels are compiled.", err=True)
