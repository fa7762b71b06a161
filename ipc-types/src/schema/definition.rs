//! [`Schema`]: the definition of what lies in a topic, made of a struct, a text, or the file that a provider has laid
//! beside its service.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use super::leaf::{Leaf, collect, find};
use super::message::Message;
use super::parse::{MAX_TEXT_LEN, SchemaError, of_layout, parse};
use crate::payload::{Layout, Number, RequestReport, SharedStruct};
use crate::random::FNV_BASIS;

/// What lies in a topic. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct Schema {
    type_name: String,
    root: Arc<Message>,
}

impl Schema {
    /// The schema of `T`.
    pub fn of<T: SharedStruct>() -> Schema {
        Schema::from_layout(T::LAYOUT)
    }

    /// The schema of a struct that this program was built with.
    ///
    /// # Panics
    ///
    /// When it is none that others could read: its comments are longer than [`MAX_LISTED_LEN`](super::MAX_LISTED_LEN).
    pub fn from_layout(layout: &'static Layout) -> Schema {
        Schema::made(layout, true)
    }

    /// The schema of `T` without its comments: for what has to know where the fields are.
    pub(crate) fn of_fields<T: SharedStruct>() -> Schema {
        Schema::made(T::LAYOUT, false)
    }

    fn made(layout: &'static Layout, is_commented: bool) -> Schema {
        let root = of_layout(layout, is_commented);
        let root = root.unwrap_or_else(|error| panic!("{}: {error}", layout.type_name));
        let type_name = layout.type_name.to_owned();
        Schema { type_name, root }
    }

    /// Reads the text of a schema.
    ///
    /// # Errors
    ///
    /// Whatever is not a schema of a struct of the contract: see [`SchemaError`].
    pub fn parse(text: &str) -> Result<Schema, SchemaError> {
        let (type_name, root) = parse(text)?;
        Ok(Schema { type_name, root })
    }

    /// Name of the type in shared memory, with package and version: `hero.DspTelemetry.v3`.
    pub fn type_name(&self) -> &str {
        &self.type_name
    }

    /// Name of the schema in an MCAP file and of the type in `ros2`, such as `hero_msgs/msg/DspTelemetry`.
    pub fn ros_resource_name(&self) -> String {
        format!("{}/msg/{}", self.root.package, self.root.name)
    }

    /// Size of the payload, bytes.
    pub fn size(&self) -> usize {
        self.root.size
    }

    /// Alignment of the payload, bytes.
    pub fn align(&self) -> usize {
        self.root.align
    }

    /// The outermost struct.
    pub fn root(&self) -> &Message {
        &self.root
    }

    /// Hash of the layout as section 8 of `docs/ipc.md` has it: the attribute `layout_hash` of a topic with this
    /// schema.
    ///
    /// So a reader can check whether a text that it found belongs to the service that it opened.
    pub fn layout_hash(&self) -> u64 {
        self.root.hash_fields(FNV_BASIS)
    }

    /// The attribute `layout_hash` of a request service whose requests have this schema: the report's fields are hashed
    /// after the request's.
    pub fn request_layout_hash(&self) -> u64 {
        static REPORT: LazyLock<Schema> = LazyLock::new(Schema::of_fields::<RequestReport>);
        REPORT.root.hash_fields(self.layout_hash())
    }

    /// All numbers, in the order of their offsets. There are at most [`MAX_NUMBERS`](super::MAX_NUMBERS).
    pub fn leaves(&self) -> Vec<Leaf<'_>> {
        let mut leaves = Vec::with_capacity(self.root.numbers);
        collect(&self.root, "", 0, &mut leaves);
        leaves
    }

    /// Offsets of all moments of the host's monotonic clock, in ascending order: fields of type `uint64` whose names
    /// end in `_ns`, but not in `epoch_ns`; nested structs and the elements of arrays included.
    ///
    /// These are what has to be translated when a sample goes to another machine, whose clock has another zero. A
    /// moment of 0 stands for "never" and stays 0. `epoch_ns` identifies a publisher and is compared for equality only.
    /// A duration is no moment: its name ends in another unit, such as `_s`, or its type is another one.
    pub fn moments(&self) -> Vec<usize> {
        let is_moment = |leaf: &Leaf<'_>| {
            let name = &leaf.field.name;
            leaf.number == Number::U64 && name.ends_with("_ns") && !name.ends_with("epoch_ns")
        };
        let leaves = self.leaves().into_iter().filter(is_moment);
        leaves
            .flat_map(|leaf| {
                let len = leaf.len.unwrap_or(1);
                (0..len).map(move |index| leaf.offset + index * leaf.number.size())
            })
            .collect()
    }

    /// The numbers at `path` and below it, such as `sequence`, `cells`, `cells[2]` or `cells[2].voltage_v`; none when
    /// there is no such field.
    pub fn find(&self, path: &str) -> Vec<Leaf<'_>> {
        find(&self.root, path).unwrap_or_default()
    }

    /// Where the one number of this type lies at `path`, bytes; `None` if there is no such number, or an array of them.
    pub fn offset_of(&self, path: &str, number: Number) -> Option<usize> {
        let leaf = self.number(path)?;
        (leaf.number == number && leaf.len.is_none()).then_some(leaf.offset)
    }

    /// The one number at `path`, an element of an array for example; `None` if it is none, or more than one.
    pub fn number(&self, path: &str) -> Option<Leaf<'_>> {
        let mut leaves = self.find(path);
        match leaves.len() {
            1 if leaves[0].path == path => leaves.pop(),
            _ => None,
        }
    }
}

/// A schema cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// No process provides such a service.
    #[error("there is no schema of `{0}`: no running process has such a topic")]
    Missing(String),
    /// It cannot be read.
    #[error("the schema {} cannot be read", .path.display())]
    Unreadable {
        /// Where it lies.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// It is none.
    #[error("the schema {} is not usable", .path.display())]
    Invalid {
        /// Where it lies.
        path: PathBuf,
        /// What is wrong with it.
        source: SchemaError,
    },
}

/// Loads the schema at `path`, and its text.
///
/// # Errors
///
/// See [`LoadError`].
pub fn load(path: &Path) -> Result<(Schema, String), LoadError> {
    let path = path.to_owned();
    let text = match read(&path) {
        Ok(text) => text,
        Err(source) => return Err(LoadError::Unreadable { path, source }),
    };
    match Schema::parse(&text) {
        Ok(schema) => Ok((schema, text)),
        Err(source) => Err(LoadError::Invalid { path, source }),
    }
}

/// Reads no more than a schema may have, and one byte that says that there is more.
fn read(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    // Before opening it, which would wait for a writer of a pipe.
    if !fs::metadata(path)?.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    File::open(path)?
        .take(MAX_TEXT_LEN as u64 + 1)
        .read_to_string(&mut text)?;
    Ok(text)
}
