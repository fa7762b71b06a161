//! Where the library writes to. It counts positions, and never seeks.

use std::io::{self, Seek, SeekFrom, Write};
use std::sync::mpsc::Sender;

/// A writer that knows how many bytes it was given.
pub(crate) struct Counted<W> {
    inner: W,
    position: u64,
}

impl<W> Counted<W> {
    pub(crate) fn new(inner: W) -> Counted<W> {
        Counted { inner, position: 0 }
    }

    pub(crate) fn into_inner(self) -> W {
        self.inner
    }
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let len = self.inner.write(bytes)?;
        self.position += len as u64;
        Ok(len)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W> Seek for Counted<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.position),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

/// Bytes that are given on at each flush, because the library keeps what it writes to.
pub(crate) struct Flushes {
    buffer: Vec<u8>,
    to: Sender<Vec<u8>>,
}

impl Flushes {
    pub(crate) fn new(to: Sender<Vec<u8>>) -> Flushes {
        Flushes {
            buffer: Vec::new(),
            to,
        }
    }

    /// What was not flushed.
    pub(crate) fn into_buffer(self) -> Vec<u8> {
        self.buffer
    }
}

impl Write for Flushes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.buffer.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        // When the other end is gone, the bytes are not wanted any more.
        let _ = self.to.send(std::mem::take(&mut self.buffer));
        Ok(())
    }
}
