//! [`Outbox`]: a way out for samples, [`Token`]: a sign that something is there, and [`Watch`]: others come.
//!
//! Zenoh waits for a peer that reads nothing when something is declared, for seconds. So all are declared in the
//! [`Background`], a thread that makes things, and drops them, one after the other. Its caller gets a [`Made`] at once,
//! and a call when something is in it; samples go out from then on.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};

use ros_messages::Reliability;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority as ZenohPriority, Reliability as ZenohReliability};
use zenoh::sample::SampleKind;

use crate::config::Priority;
use crate::failure::NetworkError;

/// What a way out is to be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// Where samples go.
    pub key: String,
    /// Which go first.
    pub priority: Priority,
    /// How they go over links that have both.
    pub reliability: Reliability,
    /// Key of the liveliness token that says that it is there, when there is one.
    pub token: Option<String>,
}

/// A way out for samples of one topic. It is declared in the background.
pub struct Outbox {
    declared: Made<Declared>,
}

/// Its token goes after it.
struct Declared {
    publisher: Publisher<'static>,
    _token: Option<LivelinessToken>,
}

/// A liveliness token: others see it as long as this exists. It is declared in the background.
pub struct Token {
    _declared: Made<LivelinessToken>,
}

impl Outbox {
    pub(super) fn open(
        background: &Background,
        session: &zenoh::Session,
        declaration: Declaration,
    ) -> Outbox {
        let session = session.clone();
        Outbox {
            declared: background.make(move || said(declare(&session, &declaration))),
        }
    }

    /// Whether samples can go out.
    pub fn is_open(&self) -> bool {
        self.declared.get().is_some()
    }

    /// Sends a sample, if it is open. It may be lost.
    pub fn send(&self, payload: Vec<u8>, attachment: Vec<u8>) {
        let Some(Declared { publisher, .. }) = self.declared.get() else {
            return;
        };
        let sent = publisher.put(payload).attachment(attachment).wait();
        if let Err(error) = sent {
            tracing::debug!(%error, "a sample was not sent");
        }
    }
}

impl Token {
    pub(super) fn open(background: &Background, session: &zenoh::Session, key: String) -> Token {
        let session = session.clone();
        Token {
            _declared: background.make(move || said(token(&session, &key))),
        }
    }
}

/// Notices when another process is connected, and when the first one begins to receive under a key, through a
/// router perhaps. It is declared in the background.
pub struct Watch {
    has_come: Arc<AtomicBool>,
    _declared: Made<Publisher<'static>>,
}

impl Watch {
    /// `arrivals` can be read when a process has come.
    pub(super) fn open(
        background: &Background,
        session: &zenoh::Session,
        key: String,
        arrivals: &Arc<OwnedFd>,
    ) -> Watch {
        let has_come = Arc::new(AtomicBool::new(false));
        let (session, arrivals) = (session.clone(), Arc::clone(arrivals));
        let noticed = Arc::clone(&has_come);
        let notice = move |has_come| {
            if has_come {
                noticed.store(true, Ordering::Release);
                let _ = rustix::io::write(&*arrivals, &1_u64.to_ne_bytes());
            }
        };
        let declare = move || -> zenoh::Result<Publisher<'static>> {
            let notice_too = notice.clone();
            let info = session.info();
            // Before any subscriber is known, Zenoh sends everything to a peer that was just connected.
            info.transport_events_listener()
                .callback(move |event| notice_too(event.kind() == SampleKind::Put))
                .background()
                .wait()?;
            let publisher = session.declare_publisher(key).wait()?;
            publisher
                .matching_listener()
                .callback(move |status| notice(status.matching()))
                .background()
                .wait()?;
            Ok(publisher)
        };
        let declared = background.make(move || {
            said(declare().map_err(|error| NetworkError::new("nobody is noticed", error)))
        });
        Watch {
            has_come,
            _declared: declared,
        }
    }

    /// Whether a process has come since the last call.
    pub fn take_arrival(&self) -> bool {
        self.has_come.swap(false, Ordering::AcqRel)
    }
}

/// What was declared. Keys are made of checked names, so it fails when the network ends.
fn said<T>(declared: Result<T, NetworkError>) -> Option<T> {
    declared
        .inspect_err(|error| tracing::warn!(%error, "nothing goes out there"))
        .ok()
}

fn declare(session: &zenoh::Session, declaration: &Declaration) -> Result<Declared, NetworkError> {
    let key = &declaration.key;
    let publisher = session
        .declare_publisher(key.clone())
        .congestion_control(CongestionControl::Drop)
        .reliability(match declaration.reliability {
            Reliability::BestEffort => ZenohReliability::BestEffort,
            Reliability::Reliable => ZenohReliability::Reliable,
        })
        .priority(zenoh_priority(declaration.priority))
        .express(true)
        .wait()
        .map_err(|error| NetworkError::new(format!("nothing can be sent to {key}"), error))?;
    let token = declaration.token.as_ref().map(|key| token(session, key));
    Ok(Declared {
        publisher,
        _token: token.transpose()?,
    })
}

fn token(session: &zenoh::Session, key: &str) -> Result<LivelinessToken, NetworkError> {
    let token = session.liveliness().declare_token(key.to_owned()).wait();
    token.map_err(|error| NetworkError::new(format!("{key} cannot be declared"), error))
}

fn zenoh_priority(priority: Priority) -> ZenohPriority {
    match priority {
        Priority::RealTime => ZenohPriority::RealTime,
        Priority::High => ZenohPriority::DataHigh,
        Priority::Data => ZenohPriority::Data,
        Priority::Low => ZenohPriority::DataLow,
        Priority::Background => ZenohPriority::Background,
    }
}

/// Something to be done in the thread.
type Task = Box<dyn FnOnce() + Send>;

enum Job {
    Do(Task),
    End,
}

/// The thread.
pub(super) struct Background {
    /// Its users bound how many jobs can wait: each thing is made once, and dropped once.
    jobs: Sender<Job>,
    /// Called after each thing that was made.
    notify: Arc<dyn Fn() + Send + Sync>,
    thread: Option<JoinHandle<()>>,
}

/// The place of a thing that is made in the background. When it is dropped, the thing is dropped in the background,
/// too.
pub(super) struct Made<T: Send + Sync + 'static> {
    place: Arc<OnceLock<T>>,
    jobs: Sender<Job>,
}

impl Background {
    /// Starts the thread. `notify` is called in it when something was made.
    ///
    /// # Errors
    ///
    /// When the operating system gives no thread.
    pub fn start(name: &str, notify: impl Fn() + Send + Sync + 'static) -> io::Result<Background> {
        let (sender, jobs) = mpsc::channel();
        let thread = thread::Builder::new()
            .name(name.to_owned())
            .spawn(move || carry_out(&jobs))?;
        Ok(Background {
            jobs: sender,
            notify: Arc::new(notify),
            thread: Some(thread),
        })
    }

    /// Makes something, after all that was given before. It stays missing when `make` returns nothing.
    pub fn make<T: Send + Sync + 'static>(
        &self,
        make: impl FnOnce() -> Option<T> + Send + 'static,
    ) -> Made<T> {
        let place = Arc::new(OnceLock::new());
        let (to_fill, notify) = (Arc::clone(&place), Arc::clone(&self.notify));
        let work = move || {
            if let Some(thing) = make() {
                // Nothing else fills the place.
                let _ = to_fill.set(thing);
                notify();
            }
        };
        // It fails after the end alone.
        let _ = self.jobs.send(Job::Do(Box::new(work)));
        Made {
            place,
            jobs: self.jobs.clone(),
        }
    }
}

impl Drop for Background {
    /// Waits until all is done that was given before.
    fn drop(&mut self) {
        let _ = self.jobs.send(Job::End);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl<T: Send + Sync + 'static> Made<T> {
    /// The thing, when it has been made.
    pub fn get(&self) -> Option<&T> {
        self.place.get()
    }
}

impl<T: Send + Sync + 'static> Drop for Made<T> {
    fn drop(&mut self) {
        let place = std::mem::take(&mut self.place);
        // After the end of the thread it is dropped here.
        let _ = self.jobs.send(Job::Do(Box::new(move || drop(place))));
    }
}

fn carry_out(jobs: &Receiver<Job>) {
    for job in jobs {
        match job {
            Job::Do(work) => work(),
            Job::End => break,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Says when it is dropped, and in which thread.
    struct Thing(Sender<thread::ThreadId>);

    impl Drop for Thing {
        fn drop(&mut self) {
            let _ = self.0.send(thread::current().id());
        }
    }

    fn background() -> (Background, Receiver<()>) {
        let (sender, made) = mpsc::channel();
        let notify = move || {
            let _ = sender.send(());
        };
        (Background::start("test", notify).unwrap(), made)
    }

    #[test]
    fn making_that_takes_long_holds_up_nothing_but_what_is_made_after_it() {
        let (background, notified) = background();
        let (release, released) = mpsc::channel();
        let slow = background.make(move || released.recv().ok());
        let next = background.make(|| Some(2));
        assert!(slow.get().is_none() && next.get().is_none());
        release.send(1).unwrap();
        notified.recv().unwrap();
        notified.recv().unwrap();
        assert_eq!((slow.get(), next.get()), (Some(&1), Some(&2)));
    }

    #[test]
    fn what_is_made_is_dropped_in_the_thread_and_dropping_waits_for_nothing() {
        let (background, notified) = background();
        let (dropper, dropped) = mpsc::channel();
        let thing = background.make(move || Some(Thing(dropper)));
        notified.recv().unwrap();
        let (release, released) = mpsc::channel::<()>();
        let slow = background.make(move || released.recv().ok());
        drop(thing);
        assert!(dropped.try_recv().is_err(), "the thread is busy");
        drop(slow);
        release.send(()).unwrap();
        assert_ne!(dropped.recv().unwrap(), thread::current().id());
    }

    #[test]
    fn a_thing_that_cannot_be_made_stays_missing() {
        let (background, notified) = background();
        let missing = background.make(|| None::<u8>);
        let made = background.make(|| Some(1));
        notified.recv().unwrap();
        assert_eq!((missing.get(), made.get()), (None, Some(&1)));
    }

    #[test]
    fn after_the_end_things_are_dropped_where_they_are() {
        let (background, notified) = background();
        let (dropper, dropped) = mpsc::channel();
        let thing = background.make(move || Some(Thing(dropper)));
        notified.recv().unwrap();
        drop(background);
        assert!(thing.get().is_some());
        drop(thing);
        assert_eq!(dropped.recv().unwrap(), thread::current().id());
    }
}
