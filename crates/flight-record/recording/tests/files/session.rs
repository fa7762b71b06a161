//! A recorder in virtual time, with a simulated disk.

use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use recording::{
    Anchor, Attachment, Channel, ChannelId, FileAction, FlightInfo, Recorder, Settings,
};

use crate::disk::Disk;

/// Unix time at the monotonic time 0.
pub const UNIX_NS: u64 = 1_700_000_000_000_000_000;

/// A recorder, its disk and its clocks.
pub struct Session {
    pub recorder: Recorder,
    pub disk: Disk,
    pub now: MonotonicNs,
    /// Unix time minus monotonic time.
    pub unix_offset_ns: u64,
    pub channels: Vec<ChannelId>,
    pub sequences: Vec<u32>,
    /// What was done, with the messages that were written before.
    pub done: Vec<(FileAction, u64)>,
    /// An action that the disk has not answered yet.
    pub outstanding: Option<FileAction>,
}

pub fn info() -> FlightInfo {
    let versions = [("version".to_owned(), "1.2.3".to_owned())];
    FlightInfo {
        robot: RobotId::new(7).expect("a number"),
        metadata: vec![("ril.flight".to_owned(), versions.into())],
        attachments: vec![Attachment {
            name: "bridge.toml".to_owned(),
            media_type: "application/toml".to_owned(),
            data: b"robot_id = 7\n".to_vec(),
        }],
    }
}

pub fn channel(number: usize) -> Channel {
    Channel {
        topic: format!("/robot7/topic{number}"),
        schema_name: format!("test_msgs/msg/Topic{number}"),
        schema_text: format!("# Number {number}.\nuint8[] data\n"),
        metadata: [("number".to_owned(), number.to_string())].into(),
    }
}

impl Session {
    pub fn new(settings: Settings, channels: usize) -> Session {
        let now = MonotonicNs(1_000_000_000);
        let mut recorder = Recorder::new(settings, info(), anchor(now, UNIX_NS));
        let channels = (0..channels).map(|number| recorder.channel(channel(number)));
        Session {
            channels: channels.map(|id| id.expect("room")).collect(),
            recorder,
            disk: Disk::default(),
            now,
            unix_offset_ns: UNIX_NS,
            sequences: vec![0; 8],
            done: Vec::new(),
            outstanding: None,
        }
    }

    /// Adds the next message of a channel.
    pub fn add(&mut self, channel: usize, len: usize) {
        let at = self.now;
        self.add_at(channel, at, len);
    }

    pub fn add_at(&mut self, channel: usize, at: MonotonicNs, len: usize) {
        self.sequences[channel] += 1;
        let sequence = self.sequences[channel];
        let data = vec![sequence as u8; len];
        let id = self.channels[channel];
        self.recorder.add(self.now, id, at, sequence, &data);
    }

    /// Performs what there is to do.
    pub fn settle(&mut self) {
        loop {
            if self.outstanding.is_none() {
                self.outstanding = self.recorder.next();
            }
            if !self.answer() {
                break;
            }
        }
    }

    /// Answers the outstanding action; whether there was one.
    pub fn answer(&mut self) -> bool {
        let Some(action) = self.outstanding.take() else {
            return false;
        };
        let result = self.disk.perform(&action);
        if result.is_ok() {
            self.done.push((action, self.recorder.totals().written));
        }
        self.recorder.done(self.now, result);
        true
    }

    /// Lets time pass, and wakes the recorder when it wants.
    pub fn pass(&mut self, duration: Duration) {
        let end = self.now + duration;
        while let Some(at) = self.recorder.deadline().filter(|at| *at <= end) {
            self.now = self.now.max(at);
            self.wake();
            self.settle();
        }
        self.now = end;
    }

    pub fn wake(&mut self) {
        let anchor = anchor(self.now, self.unix_offset_ns);
        self.recorder.wake(self.now, anchor);
    }

    pub fn split(&mut self) {
        let anchor = anchor(self.now, self.unix_offset_ns);
        self.recorder.split(self.now, anchor);
    }

    pub fn end(&mut self) {
        self.recorder.end(self.now);
        self.settle();
        assert!(self.recorder.is_ended());
        let totals = self.recorder.totals();
        assert_eq!(totals.waiting, 0);
        assert_eq!(totals.added, totals.written + totals.dropped);
    }
}

pub fn anchor(now: MonotonicNs, unix_offset_ns: u64) -> Anchor {
    Anchor {
        monotonic: now,
        unix_ns: unix_offset_ns + now.0,
    }
}
