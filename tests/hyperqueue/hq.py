"""The commands of `hq` that Lacuna uses, through the client of the Python package.

The package has the server, its workers and a client, but no `hq` command. What is asked, and what is answered, is as
with the command; the tasks are run by a real server.

    python3 hq.py --output-mode=json --server-dir=FOLDER submit --name=NAME --array=0-3 … -- COMMAND…
    python3 hq.py --output-mode=json --server-dir=FOLDER job list --all | job info ID
"""

import contextlib
import json
import os
import subprocess
import sys

from hyperqueue import Client, Job


def main(words):
    options = {}
    while words and words[0].startswith("--"):
        key, _, value = words.pop(0)[2:].partition("=")
        options[key] = value
    folder = options.get("server-dir") or os.environ["HQ_SERVER_DIR"]
    assert options["output-mode"] == "json", options
    if words[0] == "wait":
        return wait(folder, int(words[1]))
    if words[0] == "submit":
        answer = submit(folder, words[1:])
    elif words[:2] == ["job", "list"]:
        answer = [{"id": job["id"], "name": job["name"]} for job in jobs(folder)]
    elif words[:2] == ["job", "cancel"]:
        # The package has no client for it; the command answers so.
        answer = {}
    elif words[:2] == ["job", "info"]:
        answer = [info(folder, job) for job in jobs(folder) if str(job["id"]) == words[2]]
    else:
        sys.exit(f"unknown command: {words}")
    print(json.dumps(answer, indent=2))


def record(folder):
    return os.path.join(folder, "jobs.jsonl")


def jobs(folder):
    if not os.path.exists(record(folder)):
        return []
    with open(record(folder)) as lines:
        return [json.loads(line) for line in lines]


def submit(folder, words):
    split = words.index("--")
    options = dict(word[2:].split("=", 1) for word in words[:split])
    first, last = map(int, options["array"].split("-"))
    assert first == 0, options
    job = Job(name=options["name"])
    for _ in range(last + 1):
        job.program(args=words[split + 1 :], cwd=options["cwd"], stdout=None, stderr=None)
    with contextlib.redirect_stdout(sys.stderr):
        number = Client(folder).submit(job).id
    with open(record(folder), "a") as lines:
        print(json.dumps({"id": number, "name": options["name"], "tasks": last + 1}), file=lines)
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    same = [sys.executable, __file__, "--output-mode=json", f"--server-dir={folder}"]
    subprocess.Popen([*same, "wait", str(number)], start_new_session=True, **quiet)
    return {"id": number}


def ended(folder, number):
    return os.path.join(folder, f"ended-{number}.json")


def wait(folder, number):
    """Waits for a job in a process of its own and writes down which of its tasks have failed."""
    connection = Client(folder).connection
    failed = connection.wait_for_jobs([number], lambda _: None)
    tasks = connection.get_failed_tasks([number])[number] if failed else {}
    text = json.dumps({str(task): context.error for task, context in tasks.items()})
    with open(ended(folder, number) + ".part", "w") as file:
        file.write(text)
    os.rename(ended(folder, number) + ".part", ended(folder, number))


def info(folder, job):
    failed, state = {}, "running"
    if os.path.exists(ended(folder, job["id"])):
        with open(ended(folder, job["id"])) as file:
            failed, state = json.load(file), "finished"

    def task(number):
        if str(number) in failed:
            return {"id": number, "state": "failed", "error": failed[str(number)]}
        return {"id": number, "state": state}

    return {
        "info": {"id": job["id"], "name": job["name"]},
        "tasks": [task(number) for number in range(job["tasks"])],
    }


main(sys.argv[1:])
