//! [`Segment`]: shared memory that is allocated when it is made, and opened without a wait that has no end.
//!
//! iceoryx2's own segments are sparse: the kernel finds a page when it is first touched, and when `/dev/shm` is full by
//! then the process dies of SIGBUS in flight. Here a full memory is an error of the process that makes a segment. The
//! rest is iceoryx2's segment: same place, same content, so that programs with iceoryx2's variant `ipc` share them.

use std::fmt::Debug;
use std::fs::Metadata;
use std::mem::MaybeUninit;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::time::Duration;

use iceoryx2::prelude::SemanticString;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use iceoryx2_bb_memory::bump_allocator::BumpAllocator;
use iceoryx2_bb_posix::access_mode::AccessMode;
use iceoryx2_cal::dynamic_storage::posix_shared_memory as posix;
use iceoryx2_cal::dynamic_storage::{
    DynamicStorage, DynamicStorageBuilder, DynamicStorageCreateError, DynamicStorageOpenError,
    DynamicStorageOpenOrCreateError,
};
use iceoryx2_cal::named_concept::{
    FileName, NamedConcept, NamedConceptBuilder, NamedConceptConfiguration,
    NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt,
    NamedConceptPathHintRemoveError, NamedConceptRemoveError, Path as IoxPath,
};
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, open};
use rustix::io::Errno;

use crate::domain::SHM_DIR;
use crate::limits;

/// Free space that must be left when a segment is made, beside its own size, bytes.
///
/// The first pages are written before they can be allocated. Others would have to fill this much in the microseconds
/// between to turn the error into a SIGBUS.
const MARGIN_BYTES: u64 = 256 << 10;

/// What the kernel counts allocated memory of a file in.
const BLOCK_BYTES: u64 = 512;

/// How long a segment that is still empty is given: making one takes microseconds. iceoryx2 would wait without end.
const EMPTY_ATTEMPTS: u32 = 5;
const EMPTY_PAUSE: Duration = Duration::from_millis(1);

/// What can lie in a segment.
pub trait Content: Debug + Send + Sync + ZeroCopySend + 'static {}

impl<T: Debug + Send + Sync + ZeroCopySend + 'static> Content for T {}

/// A segment with a `T` at its beginning.
#[derive(Debug)]
pub struct Segment<T: Content>(posix::Storage<T>);

/// Makes or opens a [`Segment`].
#[derive(Debug)]
pub struct Builder<'builder, T: Content> {
    inner: posix::Builder<'builder, T>,
    name: FileName,
    config: posix::Configuration<T>,
    supplementary_size: usize,
}

impl<T: Content> Builder<'_, T> {
    /// Where the segment lies in the file system.
    fn path(&self) -> PathBuf {
        let name = self.config.path_for(&self.name).file_name();
        Path::new(SHM_DIR).join(String::from_utf8_lossy(name.as_bytes()).as_ref())
    }

    /// Whether there is room for it; none if the kernel does not say.
    fn has_room(&self) -> bool {
        let needed = (size_of::<T>() + self.supplementary_size) as u64 + MARGIN_BYTES;
        limits::free_memory().is_ok_and(|free| free.bytes >= needed)
    }
}

impl<T: Content> NamedConceptBuilder<Segment<T>> for Builder<'_, T> {
    fn new(name: &FileName) -> Self {
        Builder {
            inner: posix::Builder::new(name),
            name: *name,
            config: posix::Configuration::default(),
            supplementary_size: 0,
        }
    }

    fn config(mut self, config: &posix::Configuration<T>) -> Self {
        self.inner = self.inner.config(config);
        self.config = config.clone();
        self
    }
}

impl<'builder, T: Content> DynamicStorageBuilder<'builder, T, Segment<T>> for Builder<'builder, T> {
    fn has_ownership(mut self, value: bool) -> Self {
        self.inner = self.inner.has_ownership(value);
        self
    }

    /// Never: iceoryx2 asks for it for one segment of each domain, which any user could then break.
    fn enable_global_access(self, _value: bool) -> Self {
        self
    }

    fn supplementary_size(mut self, value: usize) -> Self {
        self.inner = self.inner.supplementary_size(value);
        self.supplementary_size = value;
        self
    }

    fn timeout(mut self, value: Duration) -> Self {
        self.inner = self.inner.timeout(value);
        self
    }

    fn initializer<F: FnMut(&mut MaybeUninit<T>, &mut BumpAllocator) -> bool + 'builder>(
        mut self,
        value: F,
    ) -> Self {
        self.inner = self.inner.initializer(value);
        self
    }

    fn create(self) -> Result<Segment<T>, DynamicStorageCreateError> {
        let path = self.path();
        if !self.has_room() {
            return Err(DynamicStorageCreateError::InternalError);
        }
        let segment = Segment(self.inner.create()?);
        match allocate(&path) {
            Ok(()) => Ok(segment),
            Err(errno) => {
                crate::log::debug!(path = %path.display(), %errno, "a segment cannot be allocated");
                segment.acquire_ownership();
                Err(DynamicStorageCreateError::InternalError)
            }
        }
    }

    fn open(self, access_mode: AccessMode) -> Result<Segment<T>, DynamicStorageOpenError> {
        if is_empty(&self.path()) {
            return Err(DynamicStorageOpenError::InitializationNotYetFinalized);
        }
        self.inner.open(access_mode).map(Segment)
    }

    fn open_or_create(self) -> Result<Segment<T>, DynamicStorageOpenOrCreateError> {
        let path = self.path();
        if is_empty(&path) {
            return Err(DynamicStorageOpenError::InitializationNotYetFinalized.into());
        }
        if !path.exists() && !self.has_room() {
            return Err(DynamicStorageCreateError::InternalError.into());
        }
        let segment = Segment(self.inner.open_or_create()?);
        // Also when another process has made it: what is allocated already costs a system call.
        match allocate(&path) {
            // Removed by its last user in this moment; it is ours all the same.
            Ok(()) | Err(Errno::NOENT) => Ok(segment),
            Err(_) => Err(DynamicStorageCreateError::InternalError.into()),
        }
    }
}

/// Allocates every page of the segment. One that its maker has allocated is not opened for that: a process may have no
/// descriptor to spare.
fn allocate(path: &Path) -> Result<(), Errno> {
    let is_allocated = |it: Metadata| it.len() > 0 && it.blocks() * BLOCK_BYTES >= it.len();
    if std::fs::symlink_metadata(path).is_ok_and(is_allocated) {
        return Ok(());
    }
    let file = open(
        path,
        OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW,
        Mode::empty(),
    )?;
    let len = u64::try_from(rustix::fs::fstat(&file)?.st_size).unwrap_or(0);
    if len == 0 {
        return Ok(());
    }
    loop {
        match fallocate(&file, FallocateFlags::empty(), 0, len) {
            Err(Errno::INTR) => {}
            result => return result,
        }
    }
}

/// Whether the segment stays without a length: a process was killed, or stopped, between making it and giving it one.
fn is_empty(path: &Path) -> bool {
    let is_empty = || std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.len() == 0);
    for _ in 0..EMPTY_ATTEMPTS {
        if !is_empty() {
            return false;
        }
        std::thread::sleep(EMPTY_PAUSE);
    }
    true
}

impl<T: Content> Abandonable for Segment<T> {
    #[allow(unsafe_code)]
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller's promise about the segment holds for what is in it.
        unsafe {
            posix::Storage::abandon_in_place(NonNull::from_mut(&mut this.as_mut().0));
        }
    }
}

impl<T: Content> NamedConcept for Segment<T> {
    fn name(&self) -> &FileName {
        self.0.name()
    }
}

impl<T: Content> NamedConceptMgmt for Segment<T> {
    type Configuration = posix::Configuration<T>;

    #[allow(unsafe_code)]
    unsafe fn remove_cfg(
        name: &FileName,
        config: &Self::Configuration,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: the caller's promise.
        unsafe { posix::Storage::<T>::remove_cfg(name, config) }
    }

    fn does_exist_cfg(
        name: &FileName,
        config: &Self::Configuration,
    ) -> Result<bool, NamedConceptDoesExistError> {
        posix::Storage::<T>::does_exist_cfg(name, config)
    }

    fn list_cfg(config: &Self::Configuration) -> Result<Vec<FileName>, NamedConceptListError> {
        posix::Storage::<T>::list_cfg(config)
    }

    fn remove_path_hint(value: &IoxPath) -> Result<(), NamedConceptPathHintRemoveError> {
        posix::Storage::<T>::remove_path_hint(value)
    }
}

impl<T: Content> DynamicStorage<T> for Segment<T> {
    type Builder<'builder> = Builder<'builder, T>;

    fn does_support_persistency() -> bool {
        posix::Storage::<T>::does_support_persistency()
    }

    fn has_ownership(&self) -> bool {
        self.0.has_ownership()
    }

    fn release_ownership(&self) {
        self.0.release_ownership();
    }

    fn acquire_ownership(&self) {
        self.0.acquire_ownership();
    }

    fn get(&self) -> &T {
        self.0.get()
    }

    #[allow(unsafe_code)]
    unsafe fn __internal_set_type_name_in_config(
        config: &mut Self::Configuration,
        type_name: &str,
    ) {
        // SAFETY: the caller's promise.
        unsafe {
            posix::Storage::<T>::__internal_set_type_name_in_config(config, type_name);
        }
    }
}
