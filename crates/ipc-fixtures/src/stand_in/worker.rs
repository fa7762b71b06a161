//! [`Worker`]: a thread that owns ports and is given orders, of which a stand-in with several ports is made.
//!
//! [`Inbox`]: the requests that it has received.
//!
//! Ports stay on the thread that made them. Orders are closures; a byte through a pipe wakes the thread for each.

use std::io::{PipeReader, PipeWriter, Read, Write};
use std::os::fd::AsFd;
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::{self, JoinHandle};

use crate::process::WAIT_LIMIT;
use ipc_types::{Descriptor, Domain, Ipc, OpenError, RobotId, Source, WaitError, Waiter};
use rustix::io::ioctl_fionbio;

/// What a worker owns.
pub trait Ports: Sized + 'static {
    /// What to sleep on.
    fn sources(&mut self) -> Vec<&mut dyn Source>;

    /// Handles everything that has come. False ends the worker at once, as if its process had died.
    fn drain(&mut self) -> bool;
}

/// What may wake a worker.
#[derive(Clone, Copy, PartialEq)]
enum Waker {
    Order,
    Port,
}

type Order<P> = Box<dyn FnOnce(&mut P) + Send>;

/// A thread that owns ports and is given orders. Dropping it closes the ports and ends the thread.
pub struct Worker<P: Ports> {
    name: &'static str,
    /// `None` only while dropping: both must go before the thread is waited for.
    orders: Option<(Sender<Order<P>>, PipeWriter)>,
    thread: Option<JoinHandle<()>>,
}

impl<P: Ports> Worker<P> {
    /// Joins `domain` as the process `name` and has the ports opened by its thread; returns when they are open.
    ///
    /// # Panics
    ///
    /// When that fails, with the reason.
    pub fn start(
        domain: &Domain,
        robot: RobotId,
        name: &'static str,
        open: impl FnOnce(&Ipc) -> Result<P, OpenError> + Send + 'static,
    ) -> Worker<P> {
        let (sender, orders) = mpsc::channel();
        let (bell, ringer) = std::io::pipe().expect("a pipe");
        // One that is full has rung.
        ioctl_fionbio(&ringer, true).expect("a pipe that does not block");
        let (opened, is_open) = mpsc::channel();
        let domain = domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, robot, name).expect("join the test's domain");
            let ports = open(&ipc).expect("open the services");
            let _ = opened.send(());
            work(ports, &orders, bell).expect("wait");
        });
        let worker = Worker {
            name,
            orders: Some((sender, ringer)),
            thread: Some(thread),
        };
        if is_open.recv().is_err() {
            panic!("the stand-in `{name}` could not be started");
        }
        worker
    }

    /// Has `order` carried out by the thread, and returns its result.
    ///
    /// # Panics
    ///
    /// When the worker has died.
    #[track_caller]
    pub fn call<R: Send + 'static>(&self, order: impl FnOnce(&mut P) -> R + Send + 'static) -> R {
        let (sender, result) = mpsc::channel();
        self.order(move |ports| _ = sender.send(order(ports)));
        match result.recv() {
            Ok(result) => result,
            Err(_) => panic!("the stand-in `{}` has died", self.name),
        }
    }

    /// Has `order` carried out by the thread at some time, unless it has died. Orders are carried out one by one.
    pub fn order(&self, order: impl FnOnce(&mut P) + Send + 'static) {
        if let Some((orders, ringer)) = &self.orders
            && orders.send(Box::new(order)).is_ok()
        {
            // Whoever is gone does not hear the bell; the missing result says so.
            let _ = (&*ringer).write_all(&[0]);
        }
    }

    /// Waits until the thread has ended by itself.
    pub fn join(mut self) {
        self.end();
    }

    fn end(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            // Its panic was printed; the test fails over what it did not do.
            let _ = thread.join();
        }
    }
}

impl<P: Ports> Drop for Worker<P> {
    fn drop(&mut self) {
        self.end();
    }
}

fn work<P: Ports>(
    mut ports: P,
    orders: &Receiver<Order<P>>,
    mut bell: PipeReader,
) -> Result<(), WaitError> {
    let waiter = Waiter::new();
    loop {
        loop {
            match orders.try_recv() {
                Ok(order) => order(&mut ports),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
        }
        if !ports.drain() {
            return Ok(());
        }
        let is_rung = {
            let mut rung = Descriptor::new(bell.as_fd());
            let mut sources = vec![(Waker::Order, &mut rung as &mut dyn Source)];
            sources.extend(ports.sources().into_iter().map(|port| (Waker::Port, port)));
            waiter.wait(&mut sources, None)?.has(Waker::Order)
        };
        if is_rung {
            // More rings than this ring again. When nobody is left to ring, the orders end as well.
            let mut rings = [0; 64];
            let _ = bell.read(&mut rings);
        }
    }
}

/// The reading end, in the order in which the requests came.
pub struct Inbox<T>(Receiver<T>);

impl<T> Inbox<T> {
    /// Both ends.
    pub fn new() -> (Sender<T>, Inbox<T>) {
        let (sender, receiver) = mpsc::channel();
        (sender, Inbox(receiver))
    }

    /// Waits for the next request.
    ///
    /// # Panics
    ///
    /// When none comes for [`WAIT_LIMIT`], or the stand-in has died.
    #[track_caller]
    pub fn next(&self) -> T {
        match self.0.recv_timeout(WAIT_LIMIT) {
            Ok(request) => request,
            Err(error) => panic!("no request came within {WAIT_LIMIT:?} ({error})"),
        }
    }

    /// The requests that have come so far.
    pub fn take(&self) -> Vec<T> {
        self.0.try_iter().collect()
    }
}
