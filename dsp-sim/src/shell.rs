//! The loop of the simulator's process: it carries bytes between the port and the pure [`Simulator`], and
//! sleeps until there is something to do. It decides nothing.
//!
//! The port may be gone for a time; then the DSP's bytes are lost, as on a cable without an end.
//!
//! One `poll(2)` waits for bytes, for a PC that opens or closes the port, for the request to end, and for the
//! simulator's next deadline.

use std::io;
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use runtime::notify::Notifier;
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use crate::port::{Terminal, VirtualPort};
use crate::simulator::{INPUT_PLACES, Simulator};

/// How late a wake may be, in real time, before the simulated clock is held back: a process that was stopped, or a
/// machine that slept, does not simulate what it missed in one go.
const MAX_LATE: Duration = Duration::from_secs(1);

/// What the loop did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoopCounts {
    /// How often it woke.
    pub wakes: u64,
    /// Bytes that came from the PC.
    pub received: u64,
    /// Bytes that were written to the PC's queue, read or not.
    pub sent: u64,
}

/// Runs until `termination` asks for the end; the simulated clock runs `speed` times as fast as the real one, from
/// where `simulator` stands.
///
/// # Errors
/// The port is gone and cannot come back, or waiting failed.
pub fn run(
    simulator: &mut Simulator,
    port: &mut dyn VirtualPort,
    speed: f64,
    termination: &Termination,
    supervisor: &Notifier,
) -> io::Result<LoopCounts> {
    let mut clock = SimClock::new(simulator.now(), speed);
    simulator.set_speed(speed);
    let mut summary = LoopCounts::default();
    let mut watchdog = Watchdog::new(supervisor);
    let mut buffer = [0; INPUT_PLACES];
    while !termination.requested() {
        let now = clock.now(simulator.next_deadline());
        simulator.advance(now);
        port.follow(simulator.port())?;
        match port.terminal() {
            Some(terminal) => {
                if let Err(error) = ferry(simulator, terminal, now, &mut buffer, &mut summary) {
                    port.lose(error)?;
                }
            }
            None => simulator.discard_output(),
        }
        watchdog.feed(supervisor);
        let deadline = simulator.next_deadline();
        let timeout = deadline.map(|deadline| clock.real(deadline.saturating_sub(now)));
        let timeout = timeout
            .into_iter()
            .chain(watchdog.left())
            .chain(port.retry_in())
            .min();
        sleep(port.terminal(), interest(simulator), termination, timeout)?;
        summary.wakes += 1;
    }
    Ok(summary)
}

/// Takes the PC's bytes, and sends the PC those that have passed the serial link.
fn ferry(
    simulator: &mut Simulator,
    terminal: &mut dyn Terminal,
    now: Duration,
    buffer: &mut [u8; INPUT_PLACES],
    summary: &mut LoopCounts,
) -> io::Result<()> {
    if terminal.check_peer()? {
        simulator.discard_output();
    }
    // What does not fit stays in the kernel's queue, which makes the PC wait, as a slow port would.
    let room = simulator.input_room();
    let count = terminal.read(&mut buffer[..room])?;
    simulator.receive(now, &buffer[..count]);
    summary.received += count as u64;
    summary.sent += transmit(simulator, terminal)?;
    Ok(())
}

/// Writes what has passed the serial link, as far as the PC's queue takes it; returns its length.
fn transmit(simulator: &mut Simulator, terminal: &dyn Terminal) -> io::Result<u64> {
    let mut sent = 0;
    let mut outcome = Ok(());
    simulator.transmit(|bytes| match terminal.write(bytes) {
        Ok(count) => {
            sent += count as u64;
            count
        }
        Err(error) => {
            outcome = Err(error);
            0
        }
    });
    outcome.map(|()| sent)
}

/// What to wait for at the terminal: bytes, if there is room for them, and room, if there are bytes.
fn interest(simulator: &Simulator) -> PollFlags {
    let mut flags = PollFlags::empty();
    flags.set(PollFlags::IN, simulator.input_room() > 0);
    flags.set(PollFlags::OUT, simulator.has_output());
    flags
}

/// Sleeps until the terminal is ready for `interest`, there is a peer, the wish to end, or the timeout is over.
fn sleep(
    terminal: Option<&mut dyn Terminal>,
    interest: PollFlags,
    termination: &Termination,
    timeout: Option<Duration>,
) -> io::Result<()> {
    let timeout = timeout.and_then(|timeout| Timespec::try_from(timeout).ok());
    let ending = PollFd::from_borrowed_fd(termination.as_fd(), PollFlags::IN);
    let mut sources = vec![ending];
    if let Some(terminal) = &terminal {
        sources.push(PollFd::from_borrowed_fd(terminal.descriptor(), interest));
        let watch = terminal.peer_watch();
        sources.extend(watch.map(|watch| PollFd::from_borrowed_fd(watch, PollFlags::IN)));
    }
    match poll(&mut sources, timeout.as_ref()) {
        // A signal interrupted the wait; the loop looks at everything anyway.
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// The simulated clock over the real one.
struct SimClock {
    real_start: Instant,
    simulated_start: Duration,
    speed: f64,
}

impl SimClock {
    fn new(simulated_start: Duration, speed: f64) -> SimClock {
        SimClock {
            real_start: Instant::now(),
            simulated_start,
            speed,
        }
    }

    /// The simulated time. When the loop is far too late for `deadline`, time has stood still instead.
    fn now(&mut self, deadline: Option<Duration>) -> Duration {
        let now = self.simulated_start + self.real_start.elapsed().mul_f64(self.speed);
        match deadline {
            Some(deadline) if self.real(now.saturating_sub(deadline)) > MAX_LATE => {
                tracing::warn!(late = ?self.real(now - deadline), "woke late; the simulated clock is held back");
                self.real_start = Instant::now();
                self.simulated_start = deadline;
                deadline
            }
            _ => now,
        }
    }

    /// How long a simulated time lasts.
    fn real(&self, simulated: Duration) -> Duration {
        simulated.div_f64(self.speed)
    }
}

/// When to report to the supervisor that this process is alive.
struct Watchdog {
    period: Option<Duration>,
    fed: Instant,
}

impl Watchdog {
    fn new(supervisor: &Notifier) -> Watchdog {
        Watchdog {
            period: supervisor.watchdog_period(),
            fed: Instant::now(),
        }
    }

    fn feed(&mut self, supervisor: &Notifier) {
        if self.left() == Some(Duration::ZERO) {
            supervisor.watchdog();
            self.fed = Instant::now();
        }
    }

    /// Time left until it is due; nothing without a supervisor that watches.
    fn left(&self) -> Option<Duration> {
        Some(self.period?.saturating_sub(self.fed.elapsed()))
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{File, OpenOptions};
    use std::io::{Read, Write};
    use std::thread;

    use dsp_protocol::{Command, Downlink, Status, Uplink, port};

    use super::*;
    use crate::pty::PtyPort;
    use crate::simulator::Setup;

    /// Runs the loop in a thread while `pc` uses the port that it opens.
    fn with_loop(speed: f64, pc: impl FnOnce(&dyn Fn() -> File)) -> (Simulator, LoopCounts) {
        let (termination, request) = Termination::by_hand().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dsp");
        let mut port = PtyPort::new(&path).unwrap();
        let running = thread::spawn(move || {
            let mut simulator = Simulator::new(Setup::default());
            let supervisor = Notifier::from_env();
            let outcome = run(&mut simulator, &mut port, speed, &termination, &supervisor);
            (simulator, outcome.unwrap())
        });
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        pc(&|| options.open(&path).unwrap());
        request.request();
        running.join().unwrap()
    }

    fn send(port: &mut File, command: Command) {
        let frame = Uplink::Command(command).encode();
        port.write_all(frame.as_bytes()).unwrap();
    }

    fn expect(port: &mut File, message: Downlink) {
        let frame = message.encode();
        let mut read = vec![0; frame.as_bytes().len()];
        port.read_exact(&mut read).unwrap();
        assert_eq!(read, frame.as_bytes(), "{message:?}");
    }

    #[test]
    fn the_loop_wakes_for_what_happens_and_for_nothing_else() {
        let (simulator, summary) = with_loop(1.0, |open| {
            for _ in 0..10 {
                let mut port = open();
                send(&mut port, Command::ClearErrors);
                expect(&mut port, Downlink::Ack { command: 4 });
            }
            // Then nothing happens for half a second.
            let mut port = open();
            send(
                &mut port,
                Command::Write16 {
                    port: port::STATUS_PERIOD_MS,
                    value: 500,
                },
            );
            send(&mut port, Command::ActivateStatus);
            expect(&mut port, Downlink::Ack { command: 1 });
            expect(&mut port, Downlink::Ack { command: 5 });
            expect(&mut port, Downlink::Status(Status::default()));
        });
        assert_eq!(simulator.dsp().counters().commands[4], 10);
        // Each command costs a handful: the peer comes, its bytes pass the serial link, the answer, the peer goes.
        assert!(summary.wakes < 200, "{summary:?}");
        assert!(summary.sent >= 10 * 3 + 3 + 3 + 6, "{summary:?}");
    }

    #[test]
    fn a_faster_clock_flies_a_take_off_in_no_time() {
        let (simulator, _) = with_loop(100.0, |open| {
            let mut port = open();
            send(
                &mut port,
                Command::Write16 {
                    port: port::STATUS_PERIOD_MS,
                    value: 10_000,
                },
            );
            send(&mut port, Command::ActivateStatus);
            // Started up; then no flow control comes between the statuses.
            send(&mut port, Command::Following { on: true });
            send(&mut port, Command::Following { on: false });
            send(
                &mut port,
                Command::Write16 {
                    port: port::TAKE_OFF,
                    value: 1,
                },
            );
            for command in [1, 5, 7, 7, 1] {
                expect(&mut port, Downlink::Ack { command });
            }
            // Ten simulated seconds later it is in the air.
            let flying = Status {
                flying: true,
                ..Status::default()
            };
            expect(&mut port, Downlink::Status(flying));
        });
        assert!(simulator.now() >= Duration::from_secs(10));
    }

    #[test]
    fn a_clock_that_is_far_too_late_stood_still() {
        let mut clock = SimClock::new(Duration::from_secs(5), 10.0);
        let near = clock.now(Some(Duration::from_secs(5)));
        assert!(near >= Duration::from_secs(5));
        // As if a minute had passed unseen.
        clock.real_start -= Duration::from_secs(60);
        let deadline = Duration::from_secs(6);
        assert_eq!(clock.now(Some(deadline)), deadline);
        assert!(clock.now(None) >= deadline);
        // Without a deadline nothing was missed, however long it took.
        clock.real_start -= Duration::from_secs(60);
        assert!(clock.now(None) >= Duration::from_secs(606));
    }
}
