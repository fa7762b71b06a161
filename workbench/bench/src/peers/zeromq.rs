//! ZeroMQ's publish/subscribe over `ipc://`, with the implementation in Rust, which needs no C++ compiler.

use std::path::Path;

use anyhow::{Context, Result};
use ipc_types::payload::HeroTelemetry;
use tokio::runtime::{Builder, Runtime};
use zeromq::{PubSocket, Socket, SocketRecv, SocketSend, SubSocket};

use super::ends::{Mark, PATIENCE};
use crate::plain;

fn address(site: &Path) -> String {
    format!("ipc://{}", site.join("socket").display())
}

pub struct Sender {
    socket: PubSocket,
    runtime: Runtime,
}

impl Sender {
    pub fn new(site: &Path) -> Result<Sender> {
        // The socket writes in a task of its own, as the original does in its input/output thread: it needs a thread.
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()?;
        let socket = runtime.block_on(async {
            let mut socket = PubSocket::new();
            socket.connect(&address(site)).await.map(|()| socket)
        })?;
        Ok(Sender { socket, runtime })
    }
}

impl super::ends::Sender for Sender {
    fn send(&mut self, sample: &HeroTelemetry) -> Result<()> {
        let message = plain::to_bytes(sample).to_vec();
        self.runtime.block_on(self.socket.send(message.into()))?;
        Ok(())
    }
}

pub struct Receiver {
    socket: SubSocket,
    runtime: Runtime,
}

impl Receiver {
    pub fn new(site: &Path) -> Result<Receiver> {
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let socket = runtime.block_on(async {
            let mut socket = SubSocket::new();
            socket.bind(&address(site)).await?;
            socket.subscribe("").await.map(|()| socket)
        })?;
        Ok(Receiver { socket, runtime })
    }
}

impl super::ends::Receiver for Receiver {
    fn receive(&mut self, take: &mut dyn FnMut(Mark)) -> Result<()> {
        let message = self
            .runtime
            .block_on(async { tokio::time::timeout(PATIENCE, self.socket.recv()).await })??;
        let frame = message.get(0).context("an empty message")?;
        let bytes = frame[..].try_into().context("another message")?;
        take(Mark::of(&plain::from_bytes(bytes)));
        Ok(())
    }
}
