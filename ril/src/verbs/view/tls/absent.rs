//! Stands in for TLS in a build without it: there are no values of these types.

use std::io;
use std::net::TcpStream;

use runtime::exit::{ExitCode, Failure};

use crate::view_setup::config::TlsConfig;

/// There is none.
#[derive(Clone)]
pub(in super::super) enum Tls {}

/// There is none.
pub(in super::super) enum TlsSession {}

impl Tls {
    pub fn load(_config: &TlsConfig) -> Result<Tls, Failure> {
        Err(Failure::new(
            ExitCode::Configuration,
            "this build has no TLS",
        ))
    }

    pub fn session(&self) -> io::Result<TlsSession> {
        match *self {}
    }
}

impl TlsSession {
    pub fn read(&mut self, _stream: &mut TcpStream, _plain: &mut Vec<u8>) -> io::Result<bool> {
        match *self {}
    }

    pub fn write(&mut self, _stream: &mut TcpStream, _plain: &[u8]) -> io::Result<usize> {
        match *self {}
    }

    pub fn flush(&mut self, _stream: &mut TcpStream) -> io::Result<bool> {
        match *self {}
    }
}
