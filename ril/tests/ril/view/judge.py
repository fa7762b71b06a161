"""Does with a view what robo-ws-bridge can, and prints it as JSON: judge.py ADDRESS."""

import asyncio
import json
import sys

from robo_ws_bridge import WebSocketBridgeClient

LIMIT_S = 60
TOPIC = "/robot1/bridge/state"


async def judge(address):
    client = WebSocketBridgeClient(address)
    has_message = asyncio.Event()
    found = {}

    def message(channel, time_ns, payload):
        found["message"] = payload.hex()
        has_message.set()

    client.on_message(message)
    await client.connect()
    await client.subscribe(TOPIC)
    await asyncio.wait_for(has_message.wait(), LIMIT_S)
    found["services"] = list(client.services.values())
    found["asset"] = (await client.fetch_asset("package://hero_ril/helicopter.urdf", timeout=LIMIT_S)).decode()
    found["capabilities"] = client.server_info["capabilities"]
    print(json.dumps(found))
    await client.disconnect()


asyncio.run(asyncio.wait_for(judge(sys.argv[1]), LIMIT_S))
