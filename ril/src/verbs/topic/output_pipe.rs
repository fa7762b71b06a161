//! [`OutputPipe`]: standard output when another program reads it, as in `ril echo dsp | head`.
//!
//! The next write tells that the reader has gone. On a topic that is silent there is none, so the command also waits for it.

use std::fs::File;
use std::io;
use std::os::fd::{AsFd, BorrowedFd};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FileType, fstat};

/// A pipe's end for writing.
pub(super) struct OutputPipe(File);

impl OutputPipe {
    /// Standard output of this process, if that is a pipe.
    pub(super) fn of_this_process() -> Option<OutputPipe> {
        let output = io::stdout().as_fd().try_clone_to_owned().ok()?;
        OutputPipe::of(output.into())
    }

    fn of(output: File) -> Option<OutputPipe> {
        let mode = fstat(&output).ok()?.st_mode;
        (FileType::from_raw_mode(mode) == FileType::Fifo).then_some(OutputPipe(output))
    }

    /// Whether nothing that is written will be read.
    pub(super) fn is_closed(&self) -> bool {
        let mut polled = [PollFd::new(&self.0, PollFlags::empty())];
        // Trouble of `poll` itself says nothing about the reader.
        let _ = poll(&mut polled, Some(&Timespec::default()));
        polled[0].revents().contains(PollFlags::ERR)
    }
}

impl AsFd for OutputPipe {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_is_closed_when_its_last_reader_has_gone() {
        let (reader, writer) = io::pipe().unwrap();
        let other = reader.try_clone().unwrap();
        let output = OutputPipe::of(File::from(std::os::fd::OwnedFd::from(writer))).unwrap();
        drop(reader);
        assert!(!output.is_closed());
        drop(other);
        assert!(output.is_closed());
    }

    #[test]
    fn a_file_is_no_pipe() {
        assert!(OutputPipe::of(File::open("/dev/null").unwrap()).is_none());
    }
}
