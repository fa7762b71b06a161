//! [`Ros2Outlet`]: the robot's topics for ROS 2, over the network.
//!
//! [`Topics`] decides what there is. Zenoh waits for a peer that reads nothing when something is declared, so a thread of its own
//! declares, and samples go out over a publication as soon as it is there.

use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::{SystemTime, UNIX_EPOCH};

use ipc_types::{MonotonicNs, RobotId, Schema};

use crate::Failure;
use crate::config::{Priority, Ros2Config};
use crate::network::{Declarer, Network, NetworkError, Outbox, Token};
use crate::ros2::{ATTACHMENT_LEN, Publication, Session, Topics, UnixOffset, Way};

/// The robot's topics for ROS 2.
pub struct Ros2Outlet {
    topics: Topics<Background>,
    declarations: Declarations,
}

impl Ros2Outlet {
    /// Becomes a node of ROS 2; nothing when that is not configured.
    ///
    /// # Errors
    ///
    /// When the operating system has no thread, or the network an id that ROS 2 cannot have.
    pub fn open(
        network: &Network,
        config: &Ros2Config,
        robot: RobotId,
    ) -> Result<Option<Ros2Outlet>, Failure> {
        if !config.enabled {
            return Ok(None);
        }
        let session = Session::new(config.domain_id, &network.id())?;
        let topics = Topics::new(session, robot, config.standard_messages);
        let declarations = Declarations::start(network.declarer(), topics.node().token())?;
        tracing::info!(
            domain_id = config.domain_id,
            namespace = topics.node().namespace(),
            "a node of ROS 2"
        );
        Ok(Some(Ros2Outlet {
            topics,
            declarations,
        }))
    }

    /// The relay carries a topic from now on.
    pub fn add(&mut self, key: &str, schema: &Schema, priority: Priority) {
        let declarations = &self.declarations;
        let added = self.topics.add(key, schema, |publication| {
            declarations.declare(publication, priority)
        });
        match added {
            Ok(change) => {
                declarations.undeclare(change.closed);
                if let Some(standard) = change.left_out {
                    tracing::warn!(
                        key,
                        "{} is not published for ROS 2, because a topic of the robot has its name",
                        standard.type_name()
                    );
                }
            }
            Err(error) => tracing::warn!(key, %error, "a topic is not published for ROS 2"),
        }
    }

    /// The relay sends a sample of a topic.
    pub fn send(&mut self, key: &str, sample: &[u8]) {
        let now = MonotonicNs::now();
        self.topics.send(key, sample, now, unix_offset(now));
    }
}

/// Unix time minus monotonic time, where `now` is the present moment.
fn unix_offset(now: MonotonicNs) -> UnixOffset {
    // A clock before 1970 is not set; it counts as 1970.
    let unix = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    let ns = |number: u128| i64::try_from(number).unwrap_or(i64::MAX);
    UnixOffset(ns(unix.as_nanos()) - ns(now.0.into()))
}

/// A publication that is declared in the background.
struct Background {
    declared: Arc<OnceLock<Declared>>,
}

/// A publication that is declared. Its token goes after it.
struct Declared {
    outbox: Outbox,
    _token: Token,
}

impl Way for Background {
    fn is_open(&self) -> bool {
        self.declared.get().is_some()
    }

    fn send(&self, payload: Vec<u8>, attachment: [u8; ATTACHMENT_LEN]) {
        if let Some(declared) = self.declared.get() {
            declared.outbox.send(payload, attachment.to_vec());
        }
    }
}

/// What the thread is to do.
enum Job {
    Declare {
        publication: Publication,
        priority: Priority,
        declared: Arc<OnceLock<Declared>>,
    },
    /// Dropping them undeclares them.
    Undeclare(Vec<Background>),
}

/// The thread that declares.
struct Declarations {
    /// Few jobs can wait: in one life of a relay at most [`MAX_SERVICES`](crate::station::link::MAX_SERVICES) topics and the four
    /// standard messages are declared, and each is undeclared once at most.
    ///
    /// Nothing only while dropping: it must go before the thread is waited for.
    jobs: Option<Sender<Job>>,
    thread: Option<JoinHandle<()>>,
}

impl Declarations {
    fn start(declarer: Declarer, node_token: String) -> std::io::Result<Declarations> {
        let (sender, jobs) = mpsc::channel();
        let thread = thread::Builder::new()
            .name("ros2".to_owned())
            .spawn(move || carry_out(&declarer, &node_token, &jobs))?;
        Ok(Declarations {
            jobs: Some(sender),
            thread: Some(thread),
        })
    }

    fn declare(&self, publication: &Publication, priority: Priority) -> Background {
        let declared = Arc::default();
        self.give(Job::Declare {
            publication: publication.clone(),
            priority,
            declared: Arc::clone(&declared),
        });
        Background { declared }
    }

    fn undeclare(&self, closed: Vec<Background>) {
        if !closed.is_empty() {
            self.give(Job::Undeclare(closed));
        }
    }

    fn give(&self, job: Job) {
        // It fails when the thread has ended, which it does after this value alone.
        if let Some(jobs) = &self.jobs {
            let _ = jobs.send(job);
        }
    }
}

impl Drop for Declarations {
    fn drop(&mut self) {
        self.jobs = None;
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Declares the node, and then what comes, until there is nothing to come any more.
fn carry_out(declarer: &Declarer, node_token: &str, jobs: &Receiver<Job>) {
    let node = declarer.token(node_token);
    if let Err(error) = &node {
        tracing::warn!(%error, "the robot is no node of ROS 2");
    }
    for job in jobs {
        match job {
            Job::Declare {
                publication,
                priority,
                declared: place,
            } => match declare(declarer, &publication, priority) {
                // Only this thread fills the place, and once.
                Ok(declared) => drop(place.set(declared)),
                Err(error) => {
                    let topic = publication.topic;
                    tracing::warn!(topic, %error, "a topic is not published for ROS 2");
                }
            },
            Job::Undeclare(closed) => drop(closed),
        }
    }
}

fn declare(
    declarer: &Declarer,
    publication: &Publication,
    priority: Priority,
) -> Result<Declared, NetworkError> {
    let reliability = publication.qos.reliability;
    let outbox = declarer.outbox(&publication.key_expression, priority, reliability)?;
    Ok(Declared {
        outbox,
        _token: declarer.token(&publication.token)?,
    })
}
