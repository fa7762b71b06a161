//! TLS of a connection, between its socket and the server: rustls with the cryptography of ring, which the relay has,
//! too. Nothing here blocks. Without the feature `tls` there is none.

#[cfg(not(feature = "tls"))]
pub(crate) use absent::{Tls, TlsSession};
#[cfg(feature = "tls")]
pub(crate) use session::{Tls, TlsSession};

/// The first byte of a TLS connection, a handshake record: it distinguishes TLS from HTTP.
pub(crate) const HANDSHAKE: u8 = 0x16;

#[cfg(feature = "tls")]
mod session {
    use std::fmt::Display;
    use std::io::{self, ErrorKind, Read, Write};
    use std::net::TcpStream;
    use std::path::Path;
    use std::sync::Arc;

    use runtime::exit::{ExitCode, Failure};
    use rustls::pki_types::pem::PemObject;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer};
    use rustls::{ServerConfig, ServerConnection};

    use crate::config::TlsConfig;

    /// What the server's end of all connections is made of.
    #[derive(Clone)]
    pub struct Tls(Arc<ServerConfig>);

    /// TLS of one connection.
    pub struct TlsSession(Box<ServerConnection>);

    impl Tls {
        /// Reads the certificates and the key.
        ///
        /// # Errors
        ///
        /// Code 78 when a file cannot be used, or the key is another one's.
        pub fn load(config: &TlsConfig) -> Result<Tls, Failure> {
            let (chain, key) = (&config.certificate, &config.key);
            let certificates = CertificateDer::pem_file_iter(chain)
                .and_then(Iterator::collect::<Result<Vec<_>, _>>)
                .map_err(|error| unusable(chain, error))?;
            if certificates.is_empty() {
                return Err(unusable(chain, "it has no certificate in PEM"));
            }
            let secret = PrivateKeyDer::from_pem_file(key).map_err(|error| unusable(key, error))?;
            let provider = Arc::new(rustls::crypto::ring::default_provider());
            let config = ServerConfig::builder_with_provider(provider)
                .with_safe_default_protocol_versions()
                .map_err(|error| unusable(chain, error))?
                .with_no_client_auth()
                .with_single_cert(certificates, secret)
                .map_err(|error| unusable(chain, error))?;
            Ok(Tls(Arc::new(config)))
        }

        /// For a connection that begins.
        pub fn session(&self) -> io::Result<TlsSession> {
            let connection = ServerConnection::new(self.0.clone()).map_err(io::Error::other)?;
            Ok(TlsSession(Box::new(connection)))
        }
    }

    impl TlsSession {
        /// Reads what has come, and puts what it means into `plain`. False at the end.
        pub fn read(&mut self, stream: &mut TcpStream, plain: &mut Vec<u8>) -> io::Result<bool> {
            plain.clear();
            let is_open = self.0.read_tls(stream)? > 0;
            let state = match self.0.process_new_packets() {
                Ok(state) => state,
                Err(error) => {
                    // The alert says why; it is sent as far as the kernel takes it.
                    let _ = self.flush(stream);
                    return Err(io::Error::new(ErrorKind::InvalidData, error));
                }
            };
            plain.resize(state.plaintext_bytes_to_read(), 0);
            self.0.reader().read_exact(plain)?;
            Ok(is_open && !(plain.is_empty() && state.peer_has_closed()))
        }

        /// Takes what can be written now, and says how much that was.
        pub fn write(&mut self, stream: &mut TcpStream, plain: &[u8]) -> io::Result<usize> {
            // Encrypted bytes cannot be replaced by newer ones, so no further ones are taken before these are sent.
            if !self.flush(stream)? {
                return Ok(0);
            }
            let count = self.0.writer().write(plain)?;
            self.flush(stream)?;
            Ok(count)
        }

        /// Whether all that was taken, and what the handshake says, is gone to the kernel.
        pub fn flush(&mut self, stream: &mut TcpStream) -> io::Result<bool> {
            while self.0.wants_write() {
                match self.0.write_tls(stream) {
                    Ok(_) => {}
                    Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(false),
                    Err(error) => return Err(error),
                }
            }
            Ok(true)
        }
    }

    fn unusable(file: &Path, why: impl Display) -> Failure {
        let text = format!("`[tls]` cannot be used: {}: {why}", file.display());
        Failure::new(ExitCode::Configuration, text)
            .with_next_step("`ril relay certify` makes a certificate and its key")
    }
}

/// Stands in for TLS in a build without it: there are no values of these types.
#[cfg(not(feature = "tls"))]
mod absent {
    use std::io;
    use std::net::TcpStream;

    use runtime::exit::{ExitCode, Failure};

    use crate::config::TlsConfig;

    /// There is none.
    #[derive(Clone)]
    pub enum Tls {}

    /// There is none.
    pub enum TlsSession {}

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
}
