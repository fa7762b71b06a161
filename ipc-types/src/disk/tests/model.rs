//! A model of the file system as a value: folders, files, and the locks of open ones, as Linux has them on a `tmpfs`.

use std::cell::RefCell;
use std::io;
use std::path::Path;
use std::rc::Rc;

use rustix::fs::FlockOperation;
use rustix::io::Errno;

use crate::disk::{Found, LockFile};
use crate::domain::SHM_DIR;
use crate::tests::explore::{Script, World};

type Name = Rc<str>;
type Inode = u16;

/// An open file of a process.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(crate) struct Handle {
    descriptor: u8,
    pub(crate) inode: Inode,
}

#[derive(Clone, Debug)]
pub(crate) enum Call {
    MakeFolder(Name),
    Open(Name),
    /// Makes the file if need be.
    OpenIn(Handle, Name, bool),
    /// Makes a file that is not there.
    Create(Name),
    Close(Handle),
    Flock(Handle, FlockOperation),
    IsAt(Handle, Name),
    IsUnused(Name),
    Rename(Name, Name),
    Replace(Name, Name),
    Read(Handle),
    List(Name),
    RemoveFile(Name),
    RemoveIn(Handle, Name),
    RemoveFolder(Name),
}

#[derive(Clone, Debug, Hash)]
pub(crate) enum Answer {
    Done,
    Opened(Handle),
    Yes(bool),
    Text(Name),
    Found(Vec<(Name, bool)>),
    Failed(i32),
}

impl Answer {
    fn failed(errno: Errno) -> Answer {
        Answer::Failed(errno.raw_os_error())
    }

    pub(crate) fn renamed(self) -> Result<(), Errno> {
        match self {
            Answer::Failed(errno) => Err(Errno::from_raw_os_error(errno)),
            _ => Ok(()),
        }
    }

    pub(crate) fn done(self) -> io::Result<()> {
        Ok(self.renamed()?)
    }

    pub(crate) fn open(self) -> io::Result<LockFile> {
        match self {
            Answer::Opened(handle) => Ok(LockFile::of_model(handle)),
            _ => Err(self.renamed().unwrap_err().into()),
        }
    }

    pub(crate) fn yes(self) -> bool {
        matches!(self, Answer::Yes(true))
    }

    pub(crate) fn text(self) -> Option<String> {
        match self {
            Answer::Text(text) => Some(text.to_string()),
            _ => None,
        }
    }

    pub(crate) fn found(self) -> Vec<Found> {
        let Answer::Found(found) = self else {
            return Vec::new();
        };
        let found = found.into_iter().map(|(name, is_folder)| Found {
            name: Some(name.to_string()),
            is_folder,
        });
        found.collect()
    }
}

/// What is wrong with the protocol.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(crate) enum Fault {
    None,
    /// Nobody compares inodes.
    NoCompare,
    /// A doorbell counts as that of whichever folder.
    AnyDoorbell,
    /// A rename may replace, which of folders it does to empty ones alone.
    Replaces,
    /// The locks of folders are not taken.
    NoFolderLock,
    /// A generation is announced before it is made.
    AnnouncedFirst,
    /// Nobody takes a folder from a process that stands still.
    NoPatience,
}

#[derive(Clone, Debug, Hash, PartialEq)]
enum Node {
    File(Name),
    /// Sorted by name.
    Folder(Vec<(Name, Inode)>),
}

#[derive(Clone, Copy, Debug, Hash, PartialEq)]
enum Lock {
    None,
    Shared,
    Exclusive,
}

#[derive(Clone, Copy, Debug, Hash)]
struct Open {
    who: usize,
    handle: Handle,
    lock: Lock,
}

#[derive(Clone, Debug, Hash)]
pub(crate) struct Disk {
    /// Those that have a name or are open.
    nodes: Vec<(Inode, Rc<Node>)>,
    open: Vec<Open>,
    /// Inodes that each process has made: none is ever used again.
    made: Vec<Inode>,
    fault: Fault,
}

/// More inodes than a process makes.
const INODES: Inode = 1000;

fn components(path: &str) -> impl Iterator<Item = &str> {
    let below = path.strip_prefix(SHM_DIR).unwrap_or(path);
    below.split('/').filter(|part| !part.is_empty())
}

impl Disk {
    pub(crate) fn new(processes: usize, fault: Fault) -> Disk {
        Disk {
            nodes: vec![(0, Rc::new(Node::Folder(Vec::new())))],
            open: Vec::new(),
            made: vec![1; processes],
            fault,
        }
    }

    fn node(&self, inode: Inode) -> Option<&Node> {
        let mut nodes = self.nodes.iter();
        nodes.find(|(of, _)| *of == inode).map(|(_, node)| &**node)
    }

    fn entries(&self, inode: Inode) -> Result<&Vec<(Name, Inode)>, Errno> {
        match self.node(inode).ok_or(Errno::NOENT)? {
            Node::Folder(entries) => Ok(entries),
            Node::File(_) => Err(Errno::NOTDIR),
        }
    }

    fn child(&self, folder: Inode, name: &str) -> Option<Inode> {
        let mut entries = self.entries(folder).ok()?.iter();
        entries
            .find(|(of, _)| &**of == name)
            .map(|(_, inode)| *inode)
    }

    /// What has this path.
    pub(crate) fn find(&self, path: &str) -> Option<Inode> {
        components(path).try_fold(0, |folder, name| self.child(folder, name))
    }

    /// The content of the file at a path.
    pub(crate) fn content(&self, path: &str) -> Option<&str> {
        match self.node(self.find(path)?)? {
            Node::File(text) => Some(text),
            Node::Folder(_) => None,
        }
    }

    /// Everything in the folder of shared memory.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Name> {
        self.entries(0).unwrap().iter().map(|(name, _)| name)
    }

    fn parent<'a>(&self, path: &'a str) -> Result<(Inode, &'a str), Errno> {
        let (folder, name) = path.rsplit_once('/').ok_or(Errno::NOENT)?;
        Ok((self.find(folder).ok_or(Errno::NOENT)?, name))
    }

    fn change(&mut self, folder: Inode, name: &str, to: Option<Inode>) {
        let nodes = self.nodes.iter_mut();
        for (_, node) in nodes.filter(|(of, _)| *of == folder) {
            let Node::Folder(entries) = Rc::make_mut(node) else {
                continue;
            };
            entries.retain(|(of, _)| &**of != name);
            if let Some(inode) = to {
                entries.push((name.into(), inode));
                entries.sort();
            }
        }
    }

    /// Drops what has no name and is not open.
    fn forget(&mut self) {
        let named: Vec<Inode> = self
            .nodes
            .iter()
            .filter_map(|(_, node)| match &**node {
                Node::Folder(entries) => Some(entries.iter().map(|(_, inode)| *inode)),
                Node::File(_) => None,
            })
            .flatten()
            .collect();
        let open = &self.open;
        self.nodes.retain(|(inode, _)| {
            *inode == 0
                || named.contains(inode)
                || open.iter().any(|open| open.handle.inode == *inode)
        });
    }

    fn is_named(&self, inode: Inode) -> bool {
        inode == 0
            || self.nodes.iter().any(|(_, node)| {
                matches!(&**node, Node::Folder(entries) if entries.iter().any(|(_, of)| *of == inode))
            })
    }

    fn make(&mut self, who: usize, folder: Inode, name: &str, node: Node) -> Result<Inode, Errno> {
        if self.child(folder, name).is_some() {
            return Err(Errno::EXIST);
        }
        if !self.is_named(folder) {
            return Err(Errno::NOENT);
        }
        let inode = who as Inode * INODES + self.made[who];
        self.made[who] += 1;
        self.nodes.push((inode, Rc::new(node)));
        self.nodes.sort_by_key(|(inode, _)| *inode);
        self.change(folder, name, Some(inode));
        Ok(inode)
    }

    fn open(&mut self, who: usize, inode: Inode) -> Answer {
        let is_used = |descriptor| {
            let mut open = self.open.iter();
            open.any(|open| open.who == who && open.handle.descriptor == descriptor)
        };
        let descriptor = (0..).find(|descriptor| !is_used(*descriptor)).unwrap();
        let handle = Handle { descriptor, inode };
        self.open.push(Open {
            who,
            handle,
            lock: Lock::None,
        });
        self.open
            .sort_by_key(|open| (open.who, open.handle.descriptor));
        Answer::Opened(handle)
    }

    fn flock(
        &mut self,
        who: usize,
        handle: Handle,
        operation: FlockOperation,
    ) -> Result<(), Errno> {
        let wanted = match operation {
            FlockOperation::NonBlockingLockShared => Lock::Shared,
            FlockOperation::NonBlockingLockExclusive => Lock::Exclusive,
            FlockOperation::NonBlockingUnlock => Lock::None,
            _ => panic!("nobody waits for a lock: {operation:?}"),
        };
        let is_folder = matches!(self.node(handle.inode), Some(Node::Folder(_)));
        if is_folder && self.fault == Fault::NoFolderLock {
            return Ok(());
        }
        let mine = |open: &Open| open.who == who && open.handle == handle;
        let is_in_the_way = self.open.iter().any(|other| {
            other.handle.inode == handle.inode
                && !mine(other)
                && match wanted {
                    Lock::None => false,
                    Lock::Shared => other.lock == Lock::Exclusive,
                    Lock::Exclusive => other.lock != Lock::None,
                }
        });
        let own = self.open.iter_mut().find(|open| mine(open)).unwrap();
        if own.lock == wanted {
            return Ok(());
        }
        // Linux gives the former lock back first, whatever comes of it.
        own.lock = if is_in_the_way { Lock::None } else { wanted };
        match is_in_the_way {
            true => Err(Errno::WOULDBLOCK),
            false => Ok(()),
        }
    }

    fn rename(&mut self, from: &str, to: &str) -> Result<(), Errno> {
        let ((folder, name), (to_folder, to_name)) = (self.parent(from)?, self.parent(to)?);
        let inode = self.child(folder, name).ok_or(Errno::NOENT)?;
        if let Some(other) = self.child(to_folder, to_name) {
            if self.fault != Fault::Replaces {
                return Err(Errno::EXIST);
            }
            if !self.entries(other)?.is_empty() {
                return Err(Errno::NOTEMPTY);
            }
        }
        self.change(folder, name, None);
        self.change(to_folder, to_name, Some(inode));
        Ok(())
    }

    fn remove(&mut self, folder: Inode, name: &str, is_folder: bool) -> Result<Answer, Errno> {
        let inode = self.child(folder, name).ok_or(Errno::NOENT)?;
        match self.node(inode).ok_or(Errno::NOENT)? {
            Node::Folder(entries) if is_folder && entries.is_empty() => {}
            Node::Folder(_) if is_folder => return Err(Errno::NOTEMPTY),
            Node::File(_) if !is_folder => {}
            Node::File(_) => return Err(Errno::NOTDIR),
            Node::Folder(_) => return Err(Errno::ISDIR),
        }
        self.change(folder, name, None);
        Ok(Answer::Done)
    }

    fn carry_out(&mut self, who: usize, call: &Call) -> Result<Answer, Errno> {
        Ok(match call {
            Call::MakeFolder(path) => {
                let (folder, name) = self.parent(path)?;
                self.make(who, folder, name, Node::Folder(Vec::new()))?;
                Answer::Done
            }
            Call::Open(path) => {
                let inode = self.find(path).ok_or(Errno::NOENT)?;
                self.open(who, inode)
            }
            Call::OpenIn(folder, name, makes) => {
                let inode = match self.child(folder.inode, name) {
                    Some(inode) => inode,
                    None if *makes => self.make(who, folder.inode, name, Node::File("".into()))?,
                    None => return Err(Errno::NOENT),
                };
                self.open(who, inode)
            }
            Call::Create(path) => {
                let (folder, name) = self.parent(path)?;
                let inode = self.make(who, folder, name, Node::File("".into()))?;
                self.open(who, inode)
            }
            Call::Close(handle) => {
                self.open
                    .retain(|open| open.who != who || open.handle != *handle);
                Answer::Done
            }
            Call::Flock(handle, operation) => {
                self.flock(who, *handle, *operation)?;
                Answer::Done
            }
            Call::IsAt(handle, path) => {
                Answer::Yes(self.fault == Fault::NoCompare || self.find(path) == Some(handle.inode))
            }
            Call::IsUnused(path) => {
                let inode = self.find(path).ok_or(Errno::NOENT)?;
                let mut open = self.open.iter();
                Answer::Yes(!open.any(|open| open.handle.inode == inode))
            }
            Call::Rename(from, to) => {
                self.rename(from, to)?;
                Answer::Done
            }
            Call::Replace(path, text) => {
                let (folder, name) = self.parent(path)?;
                self.change(folder, name, None);
                self.make(who, folder, name, Node::File(text.clone()))?;
                Answer::Done
            }
            Call::Read(handle) => match self.node(handle.inode) {
                Some(Node::File(text)) => Answer::Text(text.clone()),
                _ => return Err(Errno::ISDIR),
            },
            Call::List(path) => {
                let folder = self.find(path).ok_or(Errno::NOENT)?;
                let entries = self.entries(folder)?.iter();
                let is_folder = |inode| matches!(self.node(inode), Some(Node::Folder(_)));
                Answer::Found(
                    entries
                        .map(|(name, inode)| (name.clone(), is_folder(*inode)))
                        .collect(),
                )
            }
            Call::RemoveFile(path) => {
                let (folder, name) = self.parent(path)?;
                self.remove(folder, name, false)?
            }
            Call::RemoveIn(folder, name) => self.remove(folder.inode, name, false)?,
            Call::RemoveFolder(path) => {
                let (folder, name) = self.parent(path)?;
                self.remove(folder, name, true)?
            }
        })
    }
}

impl World for Disk {
    type Call = Call;
    type Answer = Answer;

    fn call(&self, who: usize, call: &Call) -> Vec<(Disk, Answer)> {
        let mut next = self.clone();
        let answer = next.carry_out(who, call).unwrap_or_else(Answer::failed);
        next.forget();
        vec![(next, answer)]
    }

    fn kill(&mut self, who: usize) {
        self.open.retain(|open| open.who != who);
        self.forget();
    }
}

/// What a thread does its calls to.
pub(crate) struct Model {
    script: Rc<Script<Disk>>,
    who: usize,
    /// Names that the process has chosen.
    pub(crate) names: u8,
    fault: Fault,
}

thread_local! {
    static MODEL: RefCell<Option<Model>> = const { RefCell::new(None) };
}

/// Runs something with its calls going to the script of the process `who`, which has chosen so many names.
pub(crate) fn with<T>(
    script: &Rc<Script<Disk>>,
    who: usize,
    names: u8,
    fault: Fault,
    run: impl FnOnce() -> T,
) -> (T, Model) {
    MODEL.set(Some(Model {
        script: Rc::clone(script),
        who,
        names,
        fault,
    }));
    let result = run();
    (result, MODEL.take().unwrap())
}

pub(crate) fn is_there() -> bool {
    MODEL.with_borrow(Option::is_some)
}

/// What comes of a call, on a thread with a model.
pub(crate) fn ask(call: impl FnOnce() -> Call) -> Option<Answer> {
    MODEL.with_borrow(|model| {
        let answer = model.as_ref()?.script.call(call());
        Some(answer.unwrap_or(Answer::failed(Errno::IO)))
    })
}

pub(crate) fn text(path: &Path) -> Name {
    path.to_str().unwrap().into()
}

pub(crate) fn close(handle: Handle) {
    ask(|| Call::Close(handle));
}

pub(crate) fn is_same(one: Handle, other: Handle) -> bool {
    let fault = MODEL.with_borrow(|model| model.as_ref().map(|model| model.fault));
    matches!(fault, Some(Fault::NoCompare | Fault::AnyDoorbell)) || one.inode == other.inode
}

pub(crate) fn is_unused(path: &Path) -> bool {
    ask(|| Call::IsUnused(text(path))).is_some_and(Answer::yes)
}

/// With the letter of its process begins a name that it has chosen.
pub(crate) fn letter(number: usize) -> char {
    char::from(b'a' + number as u8)
}

pub(crate) fn fresh_name(len: usize) -> Option<String> {
    MODEL.with_borrow_mut(|model| {
        let model = model.as_mut()?;
        model.names += 1;
        let own = [letter(model.who), letter(model.names.into())];
        Some(
            own.into_iter()
                .chain(std::iter::repeat('x'))
                .take(len)
                .collect(),
        )
    })
}

/// One call after the other, as the standard library does it.
pub(crate) fn remove_all(path: &Path) -> io::Result<()> {
    for found in crate::disk::list(path) {
        let path = path.join(found.name.unwrap());
        let removed = match found.is_folder {
            true => remove_all(&path),
            false => crate::disk::remove_file(&path),
        };
        match removed {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    crate::disk::remove_folder(path)
}
