"""Publishes what a JSON file says, ten times a second, until its standard input ends.

    {"listen": "tcp/127.0.0.1:7447", "zenoh_id": "1f2e", "tokens": ["@ros2_lv/..."],
     "samples": [{"key": "0/hero1/...", "payload": "00010000...", "attachment": "0100..."}]}
"""

import json
import pathlib
import sys
import threading

import zenoh


def main():
    plan = json.loads(pathlib.Path(sys.argv[1]).read_text())
    config = zenoh.Config()
    for key, value in {
        "id": plan["zenoh_id"],
        "mode": "peer",
        "listen/endpoints": [plan["listen"]],
        "scouting/multicast/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    ended = threading.Event()
    with zenoh.open(config) as session:
        tokens = [session.liveliness().declare_token(token) for token in plan["tokens"]]
        threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
        print(session.info.zid(), flush=True)
        while not ended.wait(0.1):
            for sample in plan["samples"]:
                payload, attachment = (bytes.fromhex(sample[part]) for part in ("payload", "attachment"))
                session.put(sample["key"], payload, attachment=attachment)
        for token in tokens:
            token.undeclare()


if __name__ == "__main__":
    main()
