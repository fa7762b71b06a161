//! The processes that are measured, from outside: started, waited for, ended.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use ril_tests::Process;
use ril_tests::process::Signal;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::child::{ALIVE, PORT, READY, RESULT};
use crate::site::Site;

/// A child in one of the roles of [`crate::child`].
pub struct Child(Process);

impl Child {
    /// Starts a child with these arguments in the domain of `site`, and waits until it is ready.
    pub fn start(site: &Site, arguments: &[&dyn Argument]) -> Result<Child> {
        let child = Child::spawn(site, arguments)?;
        let Child(mut process) = child;
        process.wait_for_line(|line| line.text == READY);
        Ok(Child(process))
    }

    /// Starts a child with these arguments in the domain of `site`, and does not wait.
    pub fn spawn(site: &Site, arguments: &[&dyn Argument]) -> Result<Child> {
        let program = std::env::current_exe()?;
        let arguments = arguments.iter().map(|argument| argument.text());
        let arguments = std::iter::once(OsString::from("child")).chain(arguments);
        let start = || Process::start(site.domain(), program, arguments);
        Ok(Child(site.start_next(start)?))
    }

    /// The process id.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Waits for the child's result.
    pub fn result<T: DeserializeOwned>(&mut self) -> Result<T> {
        loop {
            let line = self
                .0
                .wait_for_line(|line| line.text.starts_with(RESULT) || line.text == ALIVE);
            if let Some(json) = line.text.strip_prefix(RESULT) {
                return Ok(serde_json::from_str(json)?);
            }
        }
    }

    /// Asks the child to end and waits for its result.
    pub fn finish<T: DeserializeOwned>(mut self) -> Result<T> {
        self.0.signal(Signal::TERM);
        self.result()
    }

    /// Ends the child in order.
    pub fn end(mut self) {
        self.0.signal(Signal::TERM);
        self.0.wait_exit();
    }
}

/// Something that can be an argument of a child.
pub trait Argument {
    /// As it stands on the command line.
    fn text(&self) -> OsString;
}

impl Argument for &str {
    fn text(&self) -> OsString {
        self.into()
    }
}

impl Argument for String {
    fn text(&self) -> OsString {
        self.into()
    }
}

impl Argument for &Path {
    fn text(&self) -> OsString {
        self.into()
    }
}

macro_rules! arguments_by_display {
    ($($number:ty),+) => {
        $( impl Argument for $number {
            fn text(&self) -> OsString {
                self.to_string().into()
            }
        } )+
    };
}

arguments_by_display!(u32, usize, f64);

/// What of the RIL runs beside the DSP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stage {
    /// The bridge.
    Bridge,
    /// Bridge and status.
    Status,
}

/// The DSP and the RIL's own processes.
pub struct Ril {
    status: Option<Child>,
    bridge: Child,
    dsp: Child,
}

impl Ril {
    /// Starts the DSP, which sends `rate`, and the processes up to `stage`; all are ready when this returns.
    pub fn start(site: &Site, rate: &str, stage: Stage) -> Result<Ril> {
        let (dsp, port) = start_dsp(site, rate)?;
        // Empty: the defaults, whatever lies in the folder that this program is run in.
        let config = site.path().join("empty.toml");
        std::fs::write(&config, "")?;
        let (config, port) = (config.as_path(), port.as_path());
        let bridge = start_daemon(site, &[&"bridge", &"--config", &config, &"--port", &port])?;
        let status = match stage {
            Stage::Bridge => None,
            Stage::Status => Some(start_daemon(site, &[&"status", &"--config", &config])?),
        };
        Ok(Ril {
            status,
            bridge,
            dsp,
        })
    }

    /// The bridge.
    pub fn bridge(&self) -> &Child {
        &self.bridge
    }

    /// Status, if it was started.
    pub fn status(&self) -> Option<&Child> {
        self.status.as_ref()
    }

    /// Ends all of them, and says what the DSP says at its end.
    pub fn finish<T: DeserializeOwned>(self) -> Result<T> {
        if let Some(status) = self.status {
            status.end();
        }
        self.bridge.end();
        self.dsp.finish()
    }
}

/// Starts the DSP and says where its port is.
pub fn start_dsp(site: &Site, rate: &str) -> Result<(Child, PathBuf)> {
    let mut dsp = Child::start(site, &[&"dsp", &rate])?;
    let line = dsp.0.wait_for_line(|line| line.text.starts_with(PORT));
    let port = line.text.strip_prefix(PORT).context("a port")?;
    Ok((dsp, PathBuf::from(port)))
}

/// Starts one of the RIL's processes, which say in their log when they are ready.
fn start_daemon(site: &Site, arguments: &[&dyn Argument]) -> Result<Child> {
    let Child(mut process) = Child::spawn(site, arguments)?;
    process.wait_for_text("ready");
    Ok(Child(process))
}

/// `ril record`.
pub struct Recorder(Child);

/// What a recorder says at its end.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Recorded {
    /// Messages that the disk has.
    pub messages: u64,
    /// Messages that the disk did not take.
    pub dropped: u64,
    /// Samples that did not come to the recorder.
    pub lost: u64,
}

impl Recorder {
    /// Starts a recorder of every topic, whose files are in `folder`; the first one is open when this returns.
    pub fn start(site: &Site, folder: &Path) -> Result<Recorder> {
        let arguments: [&dyn Argument; 5] = [&"ril", &"record", &"--json", &"--output", &folder];
        let Child(mut process) = Child::spawn(site, &arguments)?;
        process.wait_for_text("recording");
        Ok(Recorder(Child(process)))
    }

    /// The process id.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Ends the recording, and says what became of it.
    pub fn end(self) -> Result<Recorded> {
        let Child(mut process) = self.0;
        process.signal(Signal::TERM);
        let line = process.wait_for_line(|line| line.text.contains("ril.Record.v1"));
        let recorded = serde_json::from_str(&line.text)?;
        process.wait_exit();
        Ok(recorded)
    }
}
