"""The package with itself: a publisher and a subscriber in one process. `ril-tests` runs it in shared memory of its own."""

import asyncio
import ctypes
import signal
import threading
import unittest

import hero_ril

KEY = "battery_watch/cell_voltages"


class Cell(ctypes.Structure):
    _fields_ = [("voltage_v", ctypes.c_float), ("temperature_c", ctypes.c_float)]

    @staticmethod
    def type_name():
        return "battery_watch.Cell.v1"


class Battery(ctypes.Structure):
    _fields_ = [("sequence", ctypes.c_uint64), ("epoch_ns", ctypes.c_uint64), ("cells", Cell * 12)]

    @staticmethod
    def type_name():
        return "battery_watch.Battery.v1"


def battery(voltage_v):
    sample = Battery()
    sample.cells[11].voltage_v = voltage_v
    return sample


class SetLimit(ctypes.Structure):
    _fields_ = [("request_id", ctypes.c_uint64), ("least_v", ctypes.c_double)]

    @staticmethod
    def type_name():
        return "battery_watch.SetLimit.v1"


class InRobot(unittest.TestCase):
    def setUp(self):
        self.robot = hero_ril.Robot(name="test")
        self.addCleanup(self.robot.close)


class Names(InRobot):
    def test_the_name_of_the_relay_is_its_own(self):
        with self.assertRaisesRegex(ValueError, "`relay` is the name of the RIL's own module"):
            hero_ril.Robot(name="relay")
        with self.assertRaisesRegex(ValueError, "own module `relay`"):
            self.robot.advertise("relay/battery", Battery)
        with self.assertRaisesRegex(ValueError, "own module `relay`"):
            self.robot.serve("relay/limits", SetLimit)


class Topics(InRobot):
    def test_a_topic_of_ones_own(self):
        publisher = self.robot.advertise(KEY, Battery)
        known = self.robot.subscribe(KEY, Battery)
        # All that this one has is the key.
        unknown = self.robot.subscribe(KEY, timeout=0.01)
        self.assertEqual([publisher.publish(battery(volt)) for volt in (3.5, 4.5)], [1, 2])
        self.assertEqual([sample.cells[11].voltage_v for sample in unknown], [3.5, 4.5])
        self.assertEqual(known.receive().sequence, 1)
        self.assertEqual(known.latest().sequence, 2)
        self.assertIsNone(known.receive(timeout=0))
        self.assertEqual((known.losses.received, known.losses.lost), (2, 0))
        self.assertEqual(self.robot.topics(), [(KEY, "battery_watch.Battery.v1", "test")])

    def test_arrays_of_numpy(self):
        try:
            import numpy
        except ImportError:
            self.skipTest("no NumPy")
        publisher = self.robot.advertise(KEY, Battery)
        subscriber = self.robot.subscribe(KEY, Battery)
        for volt in range(5):
            publisher.publish(battery(volt))
        array = subscriber.array()
        self.assertEqual(array.dtype, subscriber.dtype)
        numpy.testing.assert_array_equal(array["sequence"], [1, 2, 3, 4, 5])
        numpy.testing.assert_array_equal(array["cells"]["voltage_v"][:, 11], range(5))

    def test_the_schemas_of_the_robots_structures_are_those_of_the_library(self):
        for key, struct in [("hero_telemetry", hero_ril.HeroTelemetry), ("module_state", hero_ril.ModuleState)]:
            with self.robot.subscribe(key, schema=hero_ril.schema_of(struct)) as subscriber:
                self.assertEqual(ctypes.sizeof(subscriber.struct), ctypes.sizeof(struct))
            with self.robot.advertise(key, struct):
                pass

    def test_errors_say_what_to_do(self):
        with self.assertRaisesRegex(hero_ril.NotThereError, "start its bridge"):
            self.robot.take_off(10)
        with self.robot.advertise(KEY, Battery), self.assertRaisesRegex(hero_ril.TakenError, "already provided"):
            self.robot.advertise(KEY, Battery)
        with self.assertRaisesRegex(hero_ril.NotThereError, "no running process"):
            self.robot.subscribe("other/nothing")
        with self.assertRaisesRegex(hero_ril.LayoutError, "robot.s own"), self.robot.advertise(
            "hero_telemetry", Battery
        ):
            pass
        with self.assertRaises(ValueError):
            self.robot.go_to()
        subscriber = self.robot.telemetry()
        subscriber.close()
        with self.assertRaisesRegex(ValueError, "closed"):
            subscriber.receive(0)

    def test_a_signal_ends_a_wait(self):
        class Rung(Exception):
            pass

        def ring(*_):
            raise Rung

        before = signal.signal(signal.SIGALRM, ring)
        self.addCleanup(signal.signal, signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with self.assertRaises(Rung):
            self.robot.telemetry().receive()

    def test_waiting_leaves_other_threads_alone(self):
        subscriber = self.robot.subscribe(KEY, Battery)
        received = []
        thread = threading.Thread(target=lambda: received.append(subscriber.receive().sequence))
        thread.start()
        publisher = self.robot.advertise(KEY, Battery)
        publisher.publish(battery(1))
        while thread.is_alive():
            thread.join(0.01)
            publisher.tend()
        self.assertEqual(received, [1])

    def test_asyncio(self):
        async def consume():
            publisher = self.robot.advertise(KEY, Battery)
            subscriber = self.robot.subscribe(KEY, Battery, timeout=5)

            async def publish():
                for volt in range(3):
                    await asyncio.sleep(0.01)
                    publisher.publish(battery(volt))

            publishing = asyncio.create_task(publish())
            async for sample in subscriber:
                if sample.sequence == 3:
                    break
            await publishing

        asyncio.run(consume())


#: Longest wait of a test [s]; only one that hangs meets it.
WATCHDOG_S = 20


class Requests(InRobot):
    KEY = "battery_watch/limits"

    def test_a_request_of_ones_own_is_served(self):
        server = self.robot.serve(self.KEY, SetLimit)
        sent = self.robot.send(self.KEY, SetLimit(least_v=3.5))
        order = server.receive(WATCHDOG_S)
        self.assertEqual((order.data.request_id, order.data.least_v), (sent.id, 3.5))
        self.assertTrue(order.accept())
        self.assertEqual(sent.next(WATCHDOG_S).stage, "accepted")
        self.assertTrue(order.progress(value=1.5, value_valid=1))
        self.assertEqual(sent.next(WATCHDOG_S).raw.value, 1.5)
        self.assertTrue(order.is_open)
        self.assertTrue(order.done())
        self.assertEqual(sent.wait().stage, "done")
        self.assertFalse(order.is_open)
        self.assertFalse(order.progress())
        self.assertIsNone(server.receive(0))

    def test_how_an_order_ends(self):
        server = self.robot.serve(self.KEY, SetLimit)

        def end(act):
            sent = self.robot.send(self.KEY, SetLimit())
            act(server.receive(WATCHDOG_S))
            report = sent.next(WATCHDOG_S)
            return report.stage, report.reason

        def carry_out(order, fails):
            with order:
                if fails:
                    raise KeyError

        self.assertEqual(end(lambda order: order.refuse("busy")), ("refused", "busy"))
        self.assertEqual(end(lambda order: order.abort("stopped")), ("aborted", "stopped"))
        self.assertEqual(end(lambda order: carry_out(order, False)), ("done", "none"))
        with self.assertRaises(KeyError):
            end(lambda order: carry_out(order, True))
        self.assertEqual(end(lambda order: None), ("aborted", "none"), "forgotten")
        with self.assertRaisesRegex(ValueError, "no reason"):
            end(lambda order: order.refuse("of some kind"))

    def test_a_client_that_is_gone_is_known(self):
        server = self.robot.serve(self.KEY, SetLimit)
        with hero_ril.Robot(name="other") as other:
            other.send(self.KEY, SetLimit())
            order = server.receive(WATCHDOG_S)
            self.assertTrue(order.accept())
        self.assertIsNone(server.receive(WATCHDOG_S))
        self.assertTrue(order.is_vanished)
        self.assertFalse(order.done())

    def test_control_of_a_module(self):
        key, control = "battery_watch/control", hero_ril.structs.ModuleControl
        with self.robot.serve(key, control) as server:
            start = control(command=hero_ril.structs.ControlCommand.START)
            sent = self.robot.send(key, start)
            with server.receive(WATCHDOG_S) as order:
                self.assertEqual(order.data.command, start.command)
            self.assertEqual(sent.wait().stage, "done")
            with self.assertRaisesRegex(hero_ril.TakenError, "already provided"):
                self.robot.serve(key, control)
        with self.assertRaisesRegex(hero_ril.NotThereError, "module `battery_watch`"):
            self.robot.send(key, start)
        with self.assertRaises(hero_ril.LayoutError):
            self.robot.send("movement", SetLimit())
        with self.assertRaisesRegex(hero_ril.LayoutError, "robot.s own"):
            self.robot.serve("movement", SetLimit)
        with self.assertRaisesRegex(ValueError, "do not begin"):
            self.robot.serve(key, Battery)

    def test_asyncio(self):
        async def serve(server):
            async for order in server:
                with order:
                    order.progress()
                if order.data.least_v == 2:
                    break

        async def both():
            server = self.robot.serve(self.KEY, SetLimit)
            serving = asyncio.create_task(serve(server))
            for least_v in (1, 2):
                sent = self.robot.send(self.KEY, SetLimit(least_v=least_v))
                stages = [report.stage async for report in sent]
                self.assertEqual(stages, ["progress", "done"])
            await serving

        asyncio.run(both())


if __name__ == "__main__":
    unittest.main()
