"""The package with itself: a publisher and a subscriber in one process. `ril-tests` runs it in shared memory of its own."""

import asyncio
import contextlib
import ctypes
import gc
import io
import itertools
import math
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
import unittest
import unittest.mock

import hero_ril

KEY = "battery_watch/cell_voltages"

#: Longest wait of a test [s]; only one that hangs meets it.
WATCHDOG_S = 20


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
        for name in ("bridge", "status"):
            with self.assertRaisesRegex(ValueError, "name of the RIL's own module"):
                hero_ril.Robot(name=name)
            with self.assertRaisesRegex(ValueError, f"own module `{name}`"):
                self.robot.advertise(f"{name}/anything", Battery)
            with self.assertRaisesRegex(ValueError, f"own module `{name}`"):
                self.robot.serve(f"{name}/limits", SetLimit)


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

    def test_only_the_structure_of_the_topic_is_published(self):
        class Other(Battery):
            pass

        publisher = self.robot.advertise(KEY, Battery)
        self.assertEqual(publisher.publish(Other()), 1)
        size = ctypes.sizeof(Battery)
        for foreign in (size, bytes(size), hero_ril.HeroTelemetry(), (ctypes.c_uint8 * size)(), None):
            with self.assertRaisesRegex(TypeError, "Battery is wanted"):
                publisher.publish(foreign)
        with self.assertRaisesRegex(TypeError, "Structure is wanted"):
            self.robot.send("parameters", 24)

    def test_subscribers_that_are_dropped_give_up_their_places(self):
        publisher = self.robot.advertise(KEY, Battery)
        for _ in range(33):
            subscriber = self.robot.subscribe(KEY, Battery)
        kept = [self.robot.subscribe(KEY, Battery) for _ in range(31)]
        publisher.publish(battery(1))
        self.assertEqual(kept[30].receive(WATCHDOG_S).sequence, 1)
        # It waits for a place for two seconds, in which other threads go on.
        begun, ended, ticks = threading.Event(), threading.Event(), []

        def tick():
            while not ended.wait(0.01):
                ticks.append(time.monotonic())
                begun.set()

        ticking = threading.Thread(target=tick, daemon=True)
        ticking.start()
        begun.wait()
        before = len(ticks)
        with self.assertRaisesRegex(hero_ril.FullError, "32 subscribers"):
            self.robot.subscribe(KEY, Battery)
        self.assertGreater(len(ticks) - before, 5)
        ended.set()
        ticking.join()
        del subscriber
        gc.collect()
        self.robot.subscribe(KEY, Battery)

    def test_subscribers_that_were_there_before_the_publisher_hear_that_there_are_too_many(self):
        subscribers = [self.robot.subscribe(KEY, Battery) for _ in range(33)]
        with self.robot.advertise(KEY, Battery):
            with self.assertRaisesRegex(hero_ril.FullError, "32 subscribers"):
                for subscriber in subscribers:
                    subscriber.receive(0)

    def test_arrays_of_several_dimensions_and_characters(self):
        class Panel(ctypes.Structure):
            _fields_ = [
                ("sequence", ctypes.c_uint64),
                ("epoch_ns", ctypes.c_uint64),
                ("name", ctypes.c_char * 8),
                ("matrix", (ctypes.c_float * 3) * 2),
                ("cells", (Cell * 2) * 2),
            ]

            @staticmethod
            def type_name():
                return "battery_watch.Panel.v1"

        publisher = self.robot.advertise("battery_watch/panel", Panel)
        known = self.robot.subscribe("battery_watch/panel", Panel)
        unknown = self.robot.subscribe("battery_watch/panel")
        sample = Panel(name=b"left")
        sample.matrix[1][2] = 6
        sample.cells[1][0].voltage_v = 3.5
        publisher.publish(sample)
        received = known.receive(WATCHDOG_S)
        self.assertEqual((received.name, received.matrix[1][2], received.cells[1][0].voltage_v), (b"left", 6, 3.5))
        received = unknown.receive(WATCHDOG_S)
        self.assertEqual(bytes(received.name), b"left" + bytes(4))
        self.assertEqual((received.matrix[5], received.cells[2].voltage_v), (6, 3.5))

    def test_a_slice_is_asked_for_by_role(self):
        for role in ("provider", "consumer", "background"):
            thread = threading.Thread(target=hero_ril.request_slice, args=[role])
            thread.start()
            thread.join()
        with self.assertRaisesRegex(ValueError, "no role"):
            hero_ril.request_slice("captain")

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
        thread.join(WATCHDOG_S)
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


class Loops(InRobot):
    KEY = "battery_watch/limits"

    def test_a_timer_keeps_its_grid_and_counts_what_it_leaves_out(self):
        now_s = 0.0
        with unittest.mock.patch("hero_ril.loop.time.monotonic", lambda: now_s):
            timer = hero_ril.every(0.02)
            for number in range(1, 51):
                # Sleeps until the tick, and works three quarters of the period.
                now_s += timer.left_s()
                self.assertEqual(timer.take(), number)
                now_s += 0.015
            self.assertAlmostEqual(now_s, 1.015)
            now_s += 0.05
            self.assertEqual((timer.take(), timer.missed), (53, 2))
            self.assertAlmostEqual(timer.left_s(), 0.015)

    def test_a_loop_calls_its_timers_until_it_is_stopped(self):
        loop, began, ticks = hero_ril.Loop(), time.monotonic(), []

        def tick():
            ticks.append(time.monotonic() - began)
            if len(ticks) == 10:
                loop.stop()

        loop.every(0.005, tick)
        loop.run(WATCHDOG_S)
        self.assertEqual(len(ticks), 10)
        for number, at in enumerate(ticks, start=1):
            self.assertGreaterEqual(at, number * 0.005)

    def test_timers_of_a_program_with_a_loop_of_its_own(self):
        timer, began = hero_ril.every(0.01), time.monotonic()
        for number in timer:
            if number >= 10:
                break
        self.assertGreaterEqual(time.monotonic() - began, 0.1)

        async def ticks():
            timer = hero_ril.every(0.01)
            async for number in timer:
                if number >= 10:
                    return

        began = time.monotonic()
        asyncio.run(ticks())
        self.assertGreaterEqual(time.monotonic() - began, 0.1)
        for period_s in (0, -1, float("nan"), float("inf")):
            with self.assertRaisesRegex(ValueError, "above 0"):
                hero_ril.every(period_s)

    def test_callbacks_for_samples_orders_and_reports(self):
        loop, calls = hero_ril.Loop(), []
        publisher = self.robot.advertise(KEY, Battery)

        def on_report(report):
            calls.append(report.stage)
            if report.is_final:
                loop.stop()

        def on_order(order):
            calls.append(order.data.least_v)
            order.done()

        def on_sample(sample):
            calls.append(sample.sequence)
            loop.on(self.robot.send(self.KEY, SetLimit(least_v=3.5)), on_report)

        subscriber = loop.on(self.robot.subscribe(KEY, Battery), on_sample)
        loop.on(self.robot.serve(self.KEY, SetLimit), on_order)
        publisher.publish(battery(1))
        loop.run(WATCHDOG_S)
        self.assertEqual(calls, [1, 3.5, "done"])
        loop.off(subscriber)
        publisher.publish(battery(2))
        loop.run(0.05)
        self.assertEqual(len(calls), 3)

    def test_a_subscriber_that_joins_gets_the_latest_sample_of_a_publisher_that_does_nothing(self):
        publisher = self.robot.advertise(KEY, Battery)
        publisher.publish(battery(3.5))
        late = self.robot.subscribe(KEY, Battery)
        self.assertEqual(late.receive(WATCHDOG_S).cells[11].voltage_v, 3.5)

    def test_a_request_is_handed_on_once_where_that_is_asked_for(self):
        server = self.robot.serve(self.KEY, SetLimit, once=True)
        with hero_ril.Robot(name="other") as other:
            other.send(self.KEY, SetLimit(request_id=7, least_v=3.5))
            order = server.receive(WATCHDOG_S)
            order.accept()
        # Its client is gone, and one that asks again gets the reports.
        self.assertIsNone(server.receive(0.01))
        self.assertFalse(order.is_vanished)
        stages = []
        deadline = time.monotonic() + WATCHDOG_S
        while stages[-1:] != ["accepted"] and time.monotonic() < deadline:
            again = self.robot.send(self.KEY, SetLimit(request_id=7, least_v=3.5))
            self.assertIsNone(server.receive(0.01))
            stages.append(again.next(WATCHDOG_S).stage)
        self.assertTrue(order.done())
        self.assertEqual(again.wait().stage, "done")
        # From memory.
        once_more = self.robot.send(self.KEY, SetLimit(request_id=7, least_v=3.5))
        self.assertIsNone(server.receive(0.01))
        self.assertEqual(once_more.wait().stage, "done")


class Blinker(hero_ril.Module):
    """Counts what happens with it."""

    name, id = "blinker", 1003

    def open(self):
        self.happened = []

    def step(self):
        pass

    def started(self):
        self.happened.append(("started", self.is_ready, self.begin(1, "blinking", "ends")))

    def stopped(self):
        self.happened.append(("stopped", self.is_started))
        self.stop()


class Modules(InRobot):
    def control(self, command):
        request = hero_ril.structs.ModuleControl(command=command)
        return self.robot.send("blinker/control", request)

    def test_a_module_within_a_program_is_started_and_stopped_by_the_rules(self):
        with hero_ril.Robot(name="blinker") as own:
            module = Blinker.within(own)
            with self.assertRaisesRegex(hero_ril.TakenError, "already provided by `blinker`"):
                Blinker.within(own)
            states = self.robot.subscribe("blinker/state")
            self.assertFalse(module.begin(1, "too early"))
            module.run(0.01)
            start = self.control(hero_ril.structs.ControlCommand.START)
            module.run(0.05)
            # The state is there from the first turn, and the start is done.
            self.assertEqual(start.wait().stage, "done")
            self.assertTrue(module.is_working)
            module.done()
            stop = self.control(hero_ril.structs.ControlCommand.STOP)
            module.run(WATCHDOG_S)
            # Done when `stopped` has returned and the module waits again.
            self.assertIsNone(stop.next(0))
            module.run(0.01)
            self.assertEqual(stop.wait().stage, "done")
            self.assertEqual(module.happened, [("started", True, True), ("stopped", False)])
            seen = []
            while (state := states.receive(0)) is not None:
                seen.append((state.status, bytes(state.doing).rstrip(b"\0")))
                self.assertEqual(state.module_id, 1003)
            status = hero_ril.structs.ModuleStatus
            self.assertEqual(seen[0], (status.WAITING_DATA_TO_START, b""))
            self.assertIn((status.RUNNING, b"blinking"), seen)
            self.assertEqual(seen[-1], (status.ENDED, b""))

    def test_ids_and_names_are_those_that_a_module_can_have(self):
        for name, number, wrong in [("blinker", 1, "1000 to 9999"), ("a/b", 1003, "no name"), ("Blinker", 1003, "key")]:
            other = type("Other", (Blinker,), {"name": name, "id": number})
            with self.assertRaisesRegex(ValueError, wrong):
                other.within(self.robot)


class Places(unittest.TestCase):
    def test_a_moment_of_the_hosts_clock_is_utc(self):
        moment = hero_ril.utc(time.clock_gettime_ns(time.CLOCK_MONOTONIC) - 10**9)
        self.assertAlmostEqual(moment.timestamp(), time.time() - 1, delta=0.5)
        self.assertIsNone(hero_ril.utc(0))

    def test_a_sample_is_a_place_in_degrees(self):
        sample = hero_ril.HeroTelemetry()
        sample.geodetic.latitude_rad, sample.geodetic.altitude_m = math.pi / 4, 25
        self.assertEqual(hero_ril.Place.of(sample), (45, 0, 25))

    def test_a_local_frame_is_as_near_to_the_plane_as_it_says(self):
        def earth(place):
            latitude, longitude = math.radians(place.latitude_deg), math.radians(place.longitude_deg)
            squared, height = 6.69437999014e-3, place.altitude_m
            normal = 6378137.0 / math.sqrt(1 - squared * math.sin(latitude) ** 2)
            across = (normal + height) * math.cos(latitude)
            along = (normal * (1 - squared) + height) * math.sin(latitude)
            return across * math.cos(longitude), across * math.sin(longitude), along

        for (distance, bound), latitude in itertools.product([(1e3, 0.15), (1e4, 15)], [0, 37.4, -45, 60]):
            origin = hero_ril.Place(latitude, -6.0, 50)
            frame = hero_ril.LocalFrame(origin)
            sine, cosine = math.sin(math.radians(latitude)), math.cos(math.radians(latitude))
            west, south = math.sin(math.radians(6)), math.cos(math.radians(6))
            for turn in range(24):
                north, east = (distance * wave(turn * math.tau / 24) for wave in (math.cos, math.sin))
                place = frame.place(north, east, 5)
                back = frame.offset(place)
                self.assertLess(math.dist(back, (north, east, 5)), 1e-6)
                x, y, z = (there - here for there, here in zip(earth(place), earth(origin)))
                plane = (-sine * south * x + sine * west * y + cosine * z, west * x + south * y)
                self.assertLess(math.dist(plane, (north, east)), bound)

    def test_a_local_frame_crosses_the_date_line(self):
        frame = hero_ril.LocalFrame(hero_ril.Place(10, 179.9999, 0))
        self.assertLess(frame.place(0, 100).longitude_deg, -179.99)
        self.assertAlmostEqual(frame.offset(hero_ril.Place(10, -179.9999, 0)).east_m, 21.93, 2)


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

    def test_orders_whose_reports_were_not_read_do_not_keep_land_from_being_sent(self):
        server = self.robot.serve("movement", hero_ril.structs.MovementData)

        def serve():
            for _ in range(25):
                with server.receive(WATCHDOG_S) as order:
                    order.accept()

        serving = threading.Thread(target=serve)
        serving.start()
        for _ in range(24):
            self.robot.hold()
        landing = self.robot.land()
        self.assertEqual(landing.wait().stage, "done")
        serving.join()

    def test_a_step_names_the_one_before(self):
        server, asked = self.robot.serve("movement", hero_ril.structs.MovementData), []

        def serve():
            for _ in range(4):
                with server.receive(WATCHDOG_S) as order:
                    asked.append(order.data.after)
                    order.accept()

        serving = threading.Thread(target=serve)
        serving.start()
        hold = self.robot.hold()
        path = self.robot.go_to((37.4, -6.0, 20.0), (37.5, -6.0, 20.0), after=hold)
        self.robot.land(after=path).wait()
        serving.join()
        self.assertEqual(asked, [0, hold.id, hold.id, path.id])

    def test_waiting_for_a_request_that_is_over_ends_at_once(self):
        server = self.robot.serve(self.KEY, SetLimit)
        sent = self.robot.send(self.KEY, SetLimit())
        with server.receive(WATCHDOG_S):
            pass
        again = hero_ril.Request(sent._native, self.KEY, sent.id)
        self.assertEqual(sent.wait().stage, "done")
        with self.assertRaisesRegex(ValueError, "is not open"):
            again.wait()

    def test_waiting_without_an_open_request_uses_no_processor(self):
        client = self.robot._requests()
        began, used = time.monotonic(), time.process_time()
        self.assertIsNone(client.next_report(0, 0.5))
        self.assertGreaterEqual(time.monotonic() - began, 0.5)
        self.assertLess(time.process_time() - used, 0.25)

    def test_other_threads_answer_while_one_waits_for_requests(self):
        server = self.robot.serve(self.KEY, SetLimit)
        sent = [self.robot.send(self.KEY, SetLimit()) for _ in range(2)]
        orders = [server.receive(WATCHDOG_S) for _ in sent]
        waiting = threading.Thread(target=lambda: orders.append(server.receive(WATCHDOG_S)))
        waiting.start()
        # One is answered, one is dropped.
        self.assertTrue(orders.pop(0).done())
        self.assertEqual(sent[0].wait().stage, "done")
        orders.pop(0)
        gc.collect()
        with self.assertRaisesRegex(hero_ril.RequestFailed, "aborted"):
            sent[1].wait()
        self.assertTrue(waiting.is_alive())
        last = self.robot.send(self.KEY, SetLimit())
        waiting.join()
        orders.pop().done()
        self.assertEqual(last.wait().stage, "done")

    def test_a_server_that_another_thread_closes_ends_its_wait(self):
        server = self.robot.serve(self.KEY, SetLimit)
        raised = []

        def wait():
            try:
                server.receive()
            except ValueError as error:
                raised.append(str(error))

        waiting = threading.Thread(target=wait)
        waiting.start()
        server.close()
        waiting.join()
        self.assertEqual(raised, ["it is closed"])

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


class Documents(InRobot):
    def run_block(self, word, **names):
        """Runs the program of README.md that has the word in it."""
        folder = os.path.dirname(os.path.abspath(__file__))
        with open(os.path.join(folder, "../README.md"), encoding="utf-8") as readme:
            blocks = [part.split("```")[0] for part in readme.read().split("```python\n")[1:]]
        (block,) = (block for block in blocks if word in block)
        names.update(hero_ril=hero_ril, ctypes=ctypes, robot=self.robot)
        exec(textwrap.dedent(block), names)
        return names

    def test_the_programs_of_the_readme_do_what_it_says(self):
        publisher = self.robot.advertise("hero_telemetry", hero_ril.HeroTelemetry)
        publisher.publish(hero_ril.HeroTelemetry())
        printed = io.StringIO()

        class Loop(hero_ril.Loop):
            def every(self, period_s, callback):
                return super().every(period_s, lambda: callback(self))

        with unittest.mock.patch("hero_ril.Loop", Loop), contextlib.redirect_stdout(printed):
            # The sample comes from a thread of the publisher, before or after the first tick.
            self.run_block("Loop()", control=lambda loop: printed.getvalue() and loop.stop())
        self.assertEqual(printed.getvalue(), "0.0\n")

        server, asked = self.robot.serve("movement", hero_ril.structs.MovementData), []

        def serve():
            with server.receive(WATCHDOG_S) as order:
                asked.append(order.data.latitude_deg)

        serving = threading.Thread(target=serve)
        serving.start()
        self.run_block("LocalFrame")
        serving.join()
        self.assertAlmostEqual(asked[0], 20 / 110574, 6)

        struct = self.run_block("temperature_c")["Battery"]
        self.assertEqual(hero_ril.schema_of(struct), hero_ril.schema_of(Battery))


def publish_from_elsewhere(key):
    with hero_ril.Robot(name="child") as robot:
        end = robot.serve("child/end", SetLimit)
        publisher = robot.advertise(key, Battery)
        publisher.publish(battery(7))
        # Until its parent has it.
        end.receive(WATCHDOG_S).done()


class Processes(InRobot):
    def test_a_forked_child_can_use_nothing_of_its_parent_and_does_it_no_harm(self):
        publisher = self.robot.advertise(KEY, Battery)
        subscriber = self.robot.subscribe(KEY, Battery)
        server = self.robot.serve(Requests.KEY, SetLimit)
        sent = self.robot.send(Requests.KEY, SetLimit())

        def in_child():
            for call in (
                lambda: publisher.publish(battery(1)),
                subscriber.receive,
                subscriber.latest,
                server.receive,
                sent.wait,
                lambda: sent.next(0),
                lambda: self.robot.send(Requests.KEY, SetLimit()),
                lambda: self.robot.subscribe(KEY),
                self.robot.topics,
                lambda: hero_ril.Robot(name="child"),
            ):
                with self.assertRaisesRegex(hero_ril.RilError, "forked"):
                    call()
            self.robot.close()

        children = multiprocessing.get_context("fork")
        child = children.Process(target=in_child)
        child.start()
        child.join()
        self.assertEqual(child.exitcode, 0)
        self.assertEqual(publisher.publish(battery(1)), 1)
        self.assertEqual(subscriber.receive(WATCHDOG_S).sequence, 1)
        server.receive(WATCHDOG_S).done()
        self.assertEqual(sent.wait().stage, "done")

    def test_an_interpreter_that_ends_in_a_forked_child_does_its_parent_no_harm(self):
        program = '''
import os, test_hero_ril as tests
with tests.hero_ril.Robot(name="parent") as robot:
    publisher = robot.advertise(tests.KEY, tests.Battery)
    subscriber = robot.subscribe(tests.KEY, tests.Battery)
    child = os.fork()
    if child:
        assert os.waitpid(child, 0) == (child, 0)
        publisher.publish(tests.battery(1))
        assert subscriber.receive(tests.WATCHDOG_S).sequence == 1
'''
        folder = os.path.dirname(os.path.abspath(__file__))
        ended = subprocess.run([sys.executable, "-B", "-c", program], cwd=folder, timeout=60)
        self.assertEqual(ended.returncode, 0)

    def test_daemon_threads_that_are_in_any_call_at_the_interpreters_end_do_not_abort_it(self):
        program = '''
import threading, test_hero_ril as tests
robot = tests.hero_ril.Robot(name="daemon")
publisher = robot.advertise(tests.KEY, tests.Battery)
subscribers = [robot.subscribe(tests.KEY, tests.Battery) for _ in range(2)]
requests = robot.serve("daemon/limit", tests.SetLimit)
idle = robot.serve("daemon/idle", tests.SetLimit)
module = tests.Blinker.within(tests.hero_ril.Robot(name="blinker"))
def close_anew():
    with robot.subscribe(tests.KEY, tests.Battery) as subscriber:
        subscriber.receive(timeout=0)
calls = [
    lambda: publisher.publish(tests.battery(1)),
    lambda: subscribers[0].receive(timeout=0.002),
    lambda: subscribers[1].receive(timeout=60),
    lambda: robot.topics(),
    lambda: robot.send("daemon/limit", tests.SetLimit()).wait(),
    lambda: (requests.receive(1) or tests.unittest.mock.Mock()).done(),
    lambda: idle.receive(timeout=60),
    lambda: module.run(0.002),
    close_anew,
]
began = [threading.Event() for _ in calls]
def repeat(call, began):
    while True:
        began.set()
        call()
for call, event in zip(calls, began):
    threading.Thread(target=repeat, args=[call, event], daemon=True).start()
for event in began:
    event.wait()
'''
        folder = os.path.dirname(os.path.abspath(__file__))
        for _ in range(8):
            ended = subprocess.run(
                [sys.executable, "-B", "-c", program], cwd=folder, timeout=60, capture_output=True, text=True
            )
            self.assertEqual((ended.returncode, ended.stderr), (0, ""))

    def test_a_child_that_is_spawned_takes_part(self):
        subscriber = self.robot.subscribe(KEY, Battery)
        child = multiprocessing.get_context("spawn").Process(target=publish_from_elsewhere, args=[KEY])
        child.start()
        self.assertEqual(subscriber.receive(WATCHDOG_S).cells[11].voltage_v, 7)
        self.robot.send("child/end", SetLimit()).wait()
        child.join()
        self.assertEqual(child.exitcode, 0)


if __name__ == "__main__":
    unittest.main()
