"""Commands for published tables and for speed: table, bench."""

import argparse
from pathlib import Path

from cspr_jax.cli.command import Command, add_device, add_json, prepare_jax, print_json, print_line, print_table
from cspr_jax.errors import ExitCode
from cspr_jax.runtime.progress import waiting


def _add_table(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="?", help="name of a table, such as 2.1")
    parser.add_argument("--list", action="store_true", help="list the tables")
    add_json(parser)
    parser.add_argument(
        "--definition",
        choices=("grid", "scan", "equal-volume", "all"),
        help="3.3, 3.4: definition of the accessible orientations",
    )
    parser.add_argument(
        "--amplitude", choices=("quintic", "effective", "effective-c3", "all"), help="3.3, 3.4: function"
    )
    parser.add_argument("--fine", action="store_true", help="3.3, 3.4: step pi/64 instead of pi/32")
    parser.add_argument("--max-arcs", type=int, metavar="P", help="3.3, 3.4: largest number of arcs tried (default 20)")
    parser.add_argument(
        "--values", type=int, metavar="N", help="3.3, 3.4: number of values of beta-hat tried (default 20)"
    )
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="3.3, 3.4: number of processes (default 1; for 3.4 one per core, at most 8)",
    )
    parser.add_argument("--readings", action="store_true", help="show all readings of the source in full")
    parser.add_argument("--again", action="store_true", help="compute it even where an earlier run has kept its cells")
    add_device(parser)


def _table(options: argparse.Namespace) -> int:
    with waiting():
        prepare_jax(options)
        from cspr_jax.api.files import published
        from cspr_jax.published.tables import table_for_people, table_object

    if options.list:
        for name, title in published.list_tables().items():
            print_line(f"{name}  {title}")
        return ExitCode.DONE
    choices = {
        name: getattr(options, name) for name in ("definition", "amplitude", "fine", "max_arcs", "values", "workers")
    }
    with waiting():
        cells = published.table(options.name, **choices, again=options.again)
    if options.json:
        print_json(table_object(options.name, cells))
    else:
        print_table(table_for_people(options.name, cells, all_readings=options.readings))
    return ExitCode.DONE


def _add_bench(parser: argparse.ArgumentParser) -> None:
    add_json(parser)
    parser.add_argument(
        "--kernels", type=Path, metavar="DIR", help="also measure the C++ kernels in this folder, such as benchmarks"
    )
    add_device(parser, usual="a GPU if jax finds one")


def _bench(options: argparse.Namespace) -> int:
    prepare_jax(options, prefers_cpu=False)
    from cspr_jax.api.files.published import benchmark
    from cspr_jax.bench import lines

    report = benchmark(options.kernels)
    if options.json:
        print_json(report)
    else:
        for line in lines(report):
            print_line(line)
    return ExitCode.DONE


COMMANDS = (
    Command("table", "recompute a published table and compare it with the printed numbers", _add_table, _table),
    Command(
        "bench", "measure feasibility checks per second, beside a NumPy version of the same check", _add_bench, _bench
    ),
)
