//! The DSP's end of the line: a pseudo-terminal, full status frames at a rate, and an answer to every command at once.
//!
//! No model of a helicopter, no pace of the bytes: what is measured is the other end.

use std::os::fd::AsFd;
use std::time::Duration;

use anyhow::Result;
use dsp_protocol::{Command, Decoded, Decoder, Downlink, Uplink, port};
use dsp_sim::port::Terminal;
use dsp_sim::pty::Pty;
use ipc_types::MonotonicNs;
use runtime::signal::Termination;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::pace::Pace;
use crate::stream;

/// Most wake-ups a second; at higher rates several frames are written at once, as a fast line delivers them.
const MAX_TICKS_HZ: u32 = 1000;

/// Most frames of one write when nothing holds the DSP back: what the kernel's queue takes.
const FLOOD_FRAMES: u32 = 32;

/// Bytes that wait for the kernel to take them, at most about so many: an eighth of a second at 20,000 frames a second.
const MAX_UNSENT: usize = 1 << 18;

/// Most moments that are kept: ten minutes at 1 kHz.
const MAX_MOMENTS: usize = 600_000;

/// How often it looks whether it shall end.
const LONGEST_WAIT: Duration = Duration::from_millis(100);

/// How many frames a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// None at all.
    Silent,
    /// So many.
    Hz(u32),
    /// As many frames as the bridge takes.
    Flood,
}

/// The DSP's end.
pub struct Dsp {
    pty: Pty,
    decoder: Decoder<Uplink>,
    /// Bytes that the kernel has not taken.
    unsent: Vec<u8>,
    time_ms: u32,
    is_flying: bool,
    /// Just before each of the first frames was written, `CLOCK_MONOTONIC`, ns. The first has the DSP time 1.
    sent_ns: Vec<u64>,
}

impl Dsp {
    /// Opens a pseudo-terminal.
    pub fn new() -> Result<Dsp> {
        Ok(Dsp {
            pty: Pty::open()?,
            decoder: Decoder::new(),
            unsent: Vec::with_capacity(1 << 16),
            time_ms: 0,
            is_flying: true,
            sent_ns: Vec::new(),
        })
    }

    /// The bridge's end.
    pub fn path(&self) -> &std::path::Path {
        self.pty.path()
    }

    /// Talks until `termination`, and says when it sent its first frames.
    pub fn run(mut self, rate: Rate, termination: &Termination) -> Result<Vec<u64>> {
        let (ticks_hz, frames) = match rate {
            Rate::Silent => (None, 0),
            Rate::Hz(hz) => (Some(hz.min(MAX_TICKS_HZ)), hz.div_ceil(MAX_TICKS_HZ)),
            Rate::Flood => (None, FLOOD_FRAMES),
        };
        let mut pace = ticks_hz.map(Pace::new);
        while !termination.requested() {
            let now = MonotonicNs::now();
            if let Some(pace) = pace.as_mut().filter(|pace| pace.next() <= now) {
                pace.advance();
                self.send_frames(frames)?;
            }
            if rate == Rate::Flood && self.unsent.is_empty() {
                self.send_frames(frames)?;
            }
            let next = pace.as_ref().map_or(now + LONGEST_WAIT, Pace::next);
            let may_write = rate == Rate::Flood || !self.unsent.is_empty();
            self.wait(next, may_write, termination)?;
            self.answer()?;
            self.flush()?;
        }
        Ok(self.sent_ns)
    }

    fn wait(&self, until: MonotonicNs, may_write: bool, termination: &Termination) -> Result<()> {
        let timeout = until.since(MonotonicNs::now()).min(LONGEST_WAIT);
        let mut events = PollFlags::IN;
        if may_write {
            events |= PollFlags::OUT;
        }
        let mut sources = [
            PollFd::new(&self.pty, events),
            PollFd::from_borrowed_fd(termination.as_fd(), PollFlags::IN),
        ];
        match poll(&mut sources, Some(&Timespec::try_from(timeout)?)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// Like a DSP on a line that is too slow, it leaves whole frames out; they do not count as sent.
    fn send_frames(&mut self, count: u32) -> Result<()> {
        for _ in 0..count {
            if self.unsent.len() < MAX_UNSENT {
                self.send_frame();
            }
        }
        self.flush()
    }

    fn send_frame(&mut self) {
        self.time_ms += 1;
        let frame = stream::frame(self.time_ms, self.is_flying);
        if self.sent_ns.len() < MAX_MOMENTS {
            self.sent_ns.push(MonotonicNs::now().0);
        }
        self.unsent.extend_from_slice(frame.as_bytes());
    }

    /// Writes what the kernel takes.
    fn flush(&mut self) -> Result<()> {
        if !self.unsent.is_empty() {
            let count = self.pty.write(&self.unsent)?;
            self.unsent.drain(..count);
        }
        Ok(())
    }

    fn answer(&mut self) -> Result<()> {
        let mut bytes = [0; 4096];
        let count = self.pty.read(&mut bytes)?;
        let mut rest = &bytes[..count];
        loop {
            let (taken, decoded) = self.decoder.decode(rest);
            rest = &rest[taken..];
            match decoded {
                Decoded::Incomplete => return Ok(()),
                Decoded::Message(Uplink::Command(command)) => self.obey(command),
                Decoded::Message(_) | Decoded::Rejected(_) => {}
            }
        }
    }

    /// Acknowledges. A landing is over as soon as somebody asks whether it is under way, and then it flies again, so
    /// that the next one can be ordered.
    fn obey(&mut self, command: Command) {
        let code = command.code();
        let ends_landing = command == (Command::Read16 { port: port::LAND });
        if ends_landing {
            self.say_whether_it_flies(false);
        }
        let answer = match command {
            Command::Read16 { .. } => Downlink::Ack16 {
                command: code,
                value: u16::from(!ends_landing),
            },
            Command::Read32 { .. } => Downlink::Ack32 {
                command: code,
                value: 0.0,
            },
            _ => Downlink::Ack { command: code },
        };
        self.unsent.extend_from_slice(answer.encode().as_bytes());
        if ends_landing {
            self.say_whether_it_flies(true);
        }
    }

    fn say_whether_it_flies(&mut self, is_flying: bool) {
        self.is_flying = is_flying;
        self.send_frame();
    }
}
