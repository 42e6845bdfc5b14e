"""Checks the description of the calls over HTTP with tools of others: check.py PROGRAM

A service of the program is started in an empty folder. Its description has to be valid OpenAPI 3.1, a generator has to make a
client of it, and that client has to make a person, list it and read an error. Needs the packages of requirements.txt.
"""

import json
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

from openapi_spec_validator import OpenAPIV31SpecValidator

FILES = Path(sys.executable).parent


def served(program, folder):
    """A service of its own, and its address."""
    process = subprocess.Popen(
        [program, "serve", "--data", str(folder / "data"), "--listen", "127.0.0.1:0", "--no-worker"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said = []
    for line in process.stdout:
        said.append(line)
        if "dashboard at http://" in line:
            return process, line.split("dashboard at ")[1].split()[0].rstrip("/")
    sys.exit("the service did not start:\n" + "".join(said))


def description(address):
    """The document, once the service answers."""
    for _ in range(50):
        try:
            with urllib.request.urlopen(address + "/v1/openapi.json", timeout=10) as answer:
                return json.load(answer)
        except ConnectionError:
            time.sleep(0.1)
    sys.exit("the service does not answer")


def generated(document, folder):
    """The folder of a client that the generator has made without a warning of a call that it leaves out."""
    file = folder / "openapi.json"
    file.write_text(json.dumps(document), encoding="utf-8")
    client = folder / "client"
    made = subprocess.run(
        [FILES / "openapi-python-client", "generate", "--path", file, "--output-path", client, "--meta", "none"],
        capture_output=True,
        text=True,
        check=False,
    )
    said = made.stdout + made.stderr
    if made.returncode != 0 or "Unable to" in said or "Cannot parse" in said:
        sys.exit("the generator says:\n" + said)
    return client


def used(client, address):
    """Makes a person with the client, lists it, and asks for one that does not exist."""
    sys.path.insert(0, str(client.parent))
    from client import Client
    from client.api.subject_service import create_subject, get_subject, list_subjects
    from client.models import CreateSubjectRequest

    caller = Client(base_url=address)
    made = create_subject.sync(client=caller, body=CreateSubjectRequest(display_name="Ada"))
    listed = list_subjects.sync(client=caller, page_size=5)
    assert [it.name for it in listed.subjects] == [made.name], listed
    found = get_subject.sync(client=caller, subject=made.name.removeprefix("subjects/"))
    assert found.display_name == "Ada", found
    missing = get_subject.sync_detailed(client=caller, subject="none")
    assert missing.status_code == 404, missing


def main():
    program = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        process, address = served(program, folder)
        try:
            document = description(address)
            OpenAPIV31SpecValidator(document).validate()
            used(generated(document, folder), address)
        finally:
            process.terminate()
            process.wait(timeout=30)
    calls = sum(len(it) for it in document["paths"].values())
    print(f"{calls} calls and {len(document['components']['schemas'])} schemas are valid, and a generated client works")


main()
