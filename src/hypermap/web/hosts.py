"""The host names under which programs may address a server (DNS rebinding protection)."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Collection
from urllib.parse import urlsplit


def known_hosts(listening_on: str, public_url: str | None = None) -> set[str]:
    """Return by which names a server is addressed; "*" stands for any number.

    Args:
        listening_on: the address that it listens on.
        public_url: where a web server in front of it is reached.
    """
    hosts = {"localhost", "127.0.0.1", "::1", listening_on.lower()}
    if _is_number(listening_on) and ipaddress.ip_address(listening_on).is_unspecified:
        hosts |= {"*", socket.gethostname().lower(), socket.getfqdn().lower()}
    if public_url is not None:
        hosts.add((urlsplit(public_url).hostname or "").lower())
    return hosts


def is_known(host: str, hosts: Collection[str]) -> bool:
    """Return whether a Host header names the server.

    Args:
        host: the header.
        hosts: from `known_hosts`.
    """
    name = host_name(host)
    # Whoever listens everywhere may be addressed by any number, but by no other's name.
    return name in hosts or ("*" in hosts and _is_number(name))


def host_name(host: str) -> str:
    """Return the name or number in a Host header, without the port."""
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
