//! [`Port`]: what a publisher, a subscriber, a client and a server have in common, and [`Payload`]: what goes through
//! it.
//!
//! The core of each port ([`BytesPublisher`](crate::publisher::BytesPublisher) and the like) moves bytes and knows no
//! type. A port adds the one thing that a program sees of them: a struct that it was built with, or bytes that a
//! [`Schema`] describes.

use std::marker::PhantomData;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use crate::forked::Owned;
use crate::open::Offer;
use crate::payload::SharedStruct;
use crate::pollable::Pollable;
use crate::schema::Schema;
use crate::waiter::{WaitError, Waiter, Wake, sealed};

/// What goes through a port: a [`SharedStruct`], or [`Schema`] for bytes whose struct this program was not built with.
///
/// # Safety
///
/// `view` and `view_mut` return a reference to these very bytes, and every pattern of bits is a value of `View`.
#[allow(unsafe_code)]
pub unsafe trait Payload: 'static {
    /// What a program reads and fills in: the struct, or its bytes.
    type View: ?Sized;

    /// The bytes as the program sees them.
    ///
    /// # Safety
    ///
    /// They are as many, and as aligned, as the service's schema says.
    #[doc(hidden)]
    unsafe fn view(bytes: &[u8]) -> &Self::View;

    /// The bytes as the program fills them in.
    ///
    /// # Safety
    ///
    /// As of `view`.
    #[doc(hidden)]
    unsafe fn view_mut(bytes: &mut [u8]) -> &mut Self::View;

    /// The bytes of what a program sends.
    #[doc(hidden)]
    fn as_bytes(view: &Self::View) -> &[u8];

    /// Hands on bytes that may lie at any address; does nothing if they are not as many as the schema says.
    #[doc(hidden)]
    fn read(bytes: &[u8], take: impl FnOnce(&Self::View));
}

// SAFETY: by the contract of `SharedStruct`.
#[allow(unsafe_code)]
unsafe impl<T: SharedStruct> Payload for T {
    type View = T;

    unsafe fn view(bytes: &[u8]) -> &T {
        debug_assert_eq!(bytes.len(), size_of::<T>());
        // SAFETY: the service carries this very layout, by its type name, size, alignment and hash; by the caller, the
        // bytes are as many and as aligned.
        unsafe { &*bytes.as_ptr().cast::<T>() }
    }

    unsafe fn view_mut(bytes: &mut [u8]) -> &mut T {
        debug_assert_eq!(bytes.len(), size_of::<T>());
        // SAFETY: as above.
        unsafe { &mut *bytes.as_mut_ptr().cast::<T>() }
    }

    fn as_bytes(view: &T) -> &[u8] {
        view.bytes()
    }

    fn read(bytes: &[u8], take: impl FnOnce(&T)) {
        if let Some(value) = T::from_bytes(bytes) {
            take(&value);
        }
    }
}

// SAFETY: bytes are bytes.
#[allow(unsafe_code)]
unsafe impl Payload for Schema {
    type View = [u8];

    unsafe fn view(bytes: &[u8]) -> &[u8] {
        bytes
    }

    unsafe fn view_mut(bytes: &mut [u8]) -> &mut [u8] {
        bytes
    }

    fn as_bytes(view: &[u8]) -> &[u8] {
        view
    }

    fn read(bytes: &[u8], take: impl FnOnce(&[u8])) {
        take(bytes);
    }
}

/// The part of a port that moves bytes.
pub trait Core: sealed::Source {
    /// What the service carries, under which key.
    fn offer(&self) -> &Offer;

    /// The port's descriptor for an event loop outside of this crate.
    fn pollable(&self) -> &Pollable;
}

/// Makes a struct with these two fields a [`Core`].
macro_rules! core {
    ($core:ty) => {
        impl $crate::port::Core for $core {
            fn offer(&self) -> &Offer {
                &self.offer
            }

            fn pollable(&self) -> &Pollable {
                &self.pollable
            }
        }
    };
}

pub(crate) use core;

/// A [`Publisher`](crate::Publisher), [`Subscriber`](crate::Subscriber), [`Client`](crate::Client) or
/// [`Server`](crate::Server).
///
/// It can be waited for with others by a [`Waiter`], by itself with [`Port::wait`], or in an event loop of the caller's
/// own by [`Port::descriptor`]. It can be handed to another thread.
pub struct Port<C, P> {
    pub(crate) core: Owned<C>,
    pub(crate) waiter: Waiter,
    payload: PhantomData<fn(P) -> P>,
}

impl<C: Core, P> Port<C, P> {
    pub(crate) fn of(core: C) -> Port<C, P> {
        Port {
            core: Owned::new(core),
            waiter: Waiter::new(),
            payload: PhantomData,
        }
    }

    /// Key of the service.
    pub fn key(&self) -> &str {
        &self.core.offer().key
    }

    /// What lies in a sample or a request. Of a port for a struct of this program it has no comments: those are in
    /// [`Schema::of`].
    pub fn schema(&self) -> &Schema {
        &self.core.offer().schema
    }

    /// Sleeps until there is something to receive, a signal comes or `timeout` has passed. What came before returns at
    /// once. A client also wakes when its server is gone; a publisher serves its subscribers meanwhile.
    ///
    /// # Errors
    ///
    /// See [`WaitError`].
    pub fn wait(&mut self, timeout: Duration) -> Result<Wake, WaitError> {
        self.waiter.wait_for_one(&mut *self.core, timeout)
    }

    /// A file descriptor for an event loop of the caller's own, such as `epoll` or an asynchronous runtime: it can be
    /// read when there may be something to do, and every [`SAFETY_BOUND`](crate::waiter::SAFETY_BOUND) in any case.
    /// Drain the port then, or [`service`](crate::Publisher::service) the publisher; nothing else may read the
    /// descriptor. It is the same for as long as the port lives.
    ///
    /// # Errors
    ///
    /// When the process has too many descriptors, or the service more listeners than the contract allows.
    pub fn descriptor(&self) -> Result<BorrowedFd<'_>, WaitError> {
        let sealed::Sense::Port {
            doorbell, receiver, ..
        } = sealed::Source::sense(&*self.core)
        else {
            unreachable!("a port is sensed as a port");
        };
        doorbell.check_process()?;
        self.core.pollable().descriptor(receiver)
    }
}

impl<C: Core, P> sealed::Source for Port<C, P> {
    fn has_something(&self, look: sealed::Look) -> bool {
        self.core.has_something(look)
    }

    fn service(&mut self) -> bool {
        sealed::Source::service(&mut *self.core)
    }

    fn sense(&self) -> sealed::Sense<'_> {
        self.core.sense()
    }
}
