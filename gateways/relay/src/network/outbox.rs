//! [`Outbox`]: a way out for samples, [`Token`]: a sign that something is there, and [`Watch`]: others come.
//!
//! Zenoh waits for a peer that reads nothing when something is declared, for seconds. So all are declared in the background, and
//! samples go out as soon as that is done.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ros_messages::Reliability;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::{CongestionControl, Priority as ZenohPriority, Reliability as ZenohReliability};
use zenoh::sample::SampleKind;

use crate::background::{Background, Made};
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

/// Notices when another process is connected, and when somebody begins to receive under a key and nobody did, through a router
/// perhaps. It is declared in the background.
pub struct Watch {
    has_come: Arc<AtomicBool>,
    _declared: Made<Publisher<'static>>,
}

impl Watch {
    /// `arrivals` can be read when somebody has come.
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

    /// Whether somebody has come since the last call.
    pub fn has_one_come(&self) -> bool {
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
