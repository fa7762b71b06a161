//! [`ProcessorLatency`]: while the helicopter flies, no processor of the machine sleeps so deeply that a wake takes
//! long.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::helper::Helper;

/// A process that has this device open limits how long a processor may take to wake, until it closes the device: it
/// writes the limit, µs, as a binary number of 32 bits.
pub const DEVICE: &str = "/dev/cpu_dma_latency";

/// The device in a thread's hands: opening it never holds a loop up.
#[derive(Debug)]
pub struct ProcessorLatency {
    /// `None` if the configuration does not ask for it.
    thread: Option<Helper<bool, ()>>,
    is_held: bool,
}

impl ProcessorLatency {
    /// Looks whether the device may be opened, if that `is_asked`, and logs when it may not.
    pub fn start(is_asked: bool) -> ProcessorLatency {
        ProcessorLatency::at(is_asked, DEVICE.into())
    }

    fn at(is_asked: bool, device: PathBuf) -> ProcessorLatency {
        let mut latency = ProcessorLatency {
            thread: None,
            is_held: true,
        };
        if is_asked {
            let mut held: Option<File> = None;
            let (mut is_tried, mut is_refused) = (false, false);
            let work = move |is_flying: bool| {
                drop(held.take());
                if !is_flying && std::mem::replace(&mut is_tried, true) {
                    return;
                }
                match hold(&device) {
                    Ok(file) => held = is_flying.then_some(file),
                    Err(_) if std::mem::replace(&mut is_refused, true) => {}
                    Err(error) => refused(&device, &error),
                }
            };
            let thread = Helper::start("latency", 1, work);
            latency.thread = thread
                .inspect_err(|error| tracing::warn!(%error, "no thread keeps the processors awake"))
                .ok();
            latency.follow(false);
        }
        latency
    }

    /// The helicopter flies, or does not. Never waits: what the thread cannot take now, it gets at another call.
    pub fn follow(&mut self, is_flying: bool) {
        let Some(thread) = self.thread.as_ref().filter(|_| self.is_held != is_flying) else {
            return;
        };
        // Its answers have no room for more than two.
        while let Ok(Some(())) = thread.take() {}
        if thread.give(is_flying).is_ok() {
            self.is_held = is_flying;
        }
    }
}

fn hold(device: &Path) -> io::Result<File> {
    let mut file = OpenOptions::new().write(true).open(device)?;
    file.write_all(&0_i32.to_ne_bytes())?;
    Ok(file)
}

fn refused(device: &Path, error: &io::Error) {
    tracing::warn!(
        %error,
        "real time: {} cannot be opened, so processors sleep in flight; docs/install.md says which rule gives it to this user",
        device.display()
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::io::Read;

    use rustix::fs::{CWD, Mode, mkfifoat};

    /// A pipe in the device's place: who opens it to write waits until it is opened to be read.
    #[test]
    fn the_device_is_open_in_flight_alone_and_a_device_that_hangs_holds_no_loop_up() {
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("latency");
        mkfifoat(CWD, &device, Mode::RUSR | Mode::WUSR).unwrap();
        let mut latency = ProcessorLatency::at(true, device.clone());
        let mut said = Vec::new();
        let looked = File::open(&device).unwrap().read_to_end(&mut said);
        assert_eq!(
            looked.unwrap(),
            4,
            "what it asks for at the start is withdrawn at once"
        );
        for is_flying in [true, false, true] {
            latency.follow(is_flying);
        }
        let mut reader = File::open(&device).unwrap();
        let mut limit_us = [1; 4];
        reader.read_exact(&mut limit_us).unwrap();
        assert_eq!(limit_us, [0; 4]);
        while latency.is_held {
            latency.follow(false);
            std::thread::yield_now();
        }
        assert_eq!(reader.read(&mut [0]).unwrap(), 0, "it is closed");
    }

    #[test]
    fn who_did_not_ask_has_no_thread_and_who_is_refused_goes_on() {
        let mut none = ProcessorLatency::start(false);
        none.follow(true);
        assert!(none.thread.is_none());
        let mut refused = ProcessorLatency::at(true, "/proc/no-such-device".into());
        for is_flying in [true, false, true] {
            while refused.is_held != is_flying {
                refused.follow(is_flying);
                std::thread::yield_now();
            }
        }
    }
}
