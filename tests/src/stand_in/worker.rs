//! [`Worker`]: a thread that owns ports and is given orders.
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

/// What a worker owns.
pub(super) trait Ports: Sized + 'static {
    /// Opens the ports.
    fn open(ipc: &Ipc) -> Result<Self, OpenError>;

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
pub(super) struct Worker<P: Ports> {
    name: &'static str,
    /// `None` only while dropping: both must go before the thread is waited for.
    orders: Option<(Sender<Order<P>>, PipeWriter)>,
    thread: Option<JoinHandle<()>>,
}

impl<P: Ports> Worker<P> {
    /// Joins `domain` as the process `name` and opens the ports; returns when they are open.
    ///
    /// # Panics
    ///
    /// When that fails, with the reason.
    pub fn start(
        domain: &Domain,
        robot: RobotId,
        name: &'static str,
        set_up: impl FnOnce(&mut P) + Send + 'static,
    ) -> Worker<P> {
        let (sender, orders) = mpsc::channel();
        let (bell, ringer) = std::io::pipe().expect("a pipe");
        let (opened, is_open) = mpsc::channel();
        let domain = domain.clone();
        let thread = thread::spawn(move || {
            let ipc = Ipc::join(&domain, robot, name).expect("join the test's domain");
            let mut ports = P::open(&ipc).expect("open the services");
            set_up(&mut ports);
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
        let order: Order<P> = Box::new(move |ports| {
            let _ = sender.send(order(ports));
        });
        if let Some((orders, ringer)) = &self.orders
            && orders.send(order).is_ok()
        {
            // Whoever is gone does not hear the bell; the missing result says so.
            let _ = (&*ringer).write_all(&[0]);
        }
        match result.recv() {
            Ok(result) => result,
            Err(_) => panic!("the stand-in `{}` has died", self.name),
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
pub(super) struct Inbox<T>(Receiver<T>);

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
