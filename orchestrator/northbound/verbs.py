"""The verbs of what is shown outside: serve it, and say who may log in.

Each imports its dependencies when it runs, so that none waits for another's libraries.
"""

import argparse

from orchestrator.errors import OrchestratorError


def add_northbound_verbs(verbs: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """`serve` and `user`."""
    serve = verbs.add_parser("serve", help="serve the page of a station for browsers, beside the service")
    serve.add_argument(
        "file", nargs="?", default="northbound.yaml", help="the northbound file (default: northbound.yaml)"
    )
    serve.set_defaults(run=_serve)
    user = verbs.add_parser("user", help="say who may log in to the page, and with which password")
    user.add_argument("action", choices=("add",), help="add: a new user, or a new password or role for one")
    user.add_argument("name", metavar="NAME", help="the user's name")
    user.add_argument("--role", choices=("operator", "viewer"), required=True, help="viewer: may look and not act")
    user.add_argument("--file", default="users.yaml", help="the file of users (default: users.yaml)")
    user.set_defaults(run=_user)


def _serve(arguments: argparse.Namespace) -> int:
    try:
        from orchestrator.northbound.serve import serve
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] == "orchestrator":
            raise
        from orchestrator.extras import install_extra

        raise OrchestratorError(f"the page needs the package {error.name}: {install_extra('web')}") from None
    return serve(arguments.file)


def _user(arguments: argparse.Namespace) -> int:
    from orchestrator.northbound.user_verb import add_user

    return add_user(arguments.name, arguments.role, arguments.file)
