//! [`Background`]: a thread that makes things, and drops them, because both may take long, one after the other.
//!
//! The caller gets a [`Made`] at once, and a call when something is in it.

use std::io;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};

/// Something to be done in the thread.
type Task = Box<dyn FnOnce() + Send>;

enum Job {
    Do(Task),
    End,
}

/// The thread.
pub struct Background {
    /// Its users bound how many jobs can wait: each thing is made once, and dropped once.
    jobs: Sender<Job>,
    /// Called after each thing that was made.
    notify: Arc<dyn Fn() + Send + Sync>,
    thread: Option<JoinHandle<()>>,
}

/// The place of a thing that is made in the background. When it is dropped, the thing is dropped in the background, too.
pub struct Made<T: Send + Sync + 'static> {
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
