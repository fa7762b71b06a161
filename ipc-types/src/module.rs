//! [`Module`]: a module of the robot by its name and id, and the two services that every module in a crate of its own
//! has.
//!
//! | service | key | struct |
//! |---|---|---|
//! | how the module is | `<module>/state` | [`State`], as [`StateOf`] the module |
//! | start and stop | `<module>/control` | [`ModuleControl`], as [`ControlOf`] the module |
//!
//! The bridge is older than this rule: its services are `module_state`, which says more, and `module_control`.
//! [`StatusModule`] and [`RelayModule`] have the first of the two services and no control: they command nothing by
//! themselves, so there is nothing to start or stop, and a server among their ports would make each sample of telemetry
//! some microseconds older.

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut, RangeInclusive};

use serde::ser::{Serialize, Serializer};

use crate::code::{ControlCommand, ImiCode, ModuleId, ModuleStatus};
use crate::payload::support::ZeroCopySend;
use crate::payload::{Layout, ModuleControl, SharedStruct, ascii_bytes, ascii_text};
pub use crate::service::is_own_name;
use crate::service::{is_key, module_of};
use crate::{Request, Topic};

/// Ids of modules outside the RIL. Below are the RIL's own ([`ModuleId`]).
///
/// There is no registry: an id is unique among the modules of one robot, which its operator sees to. The name
/// distinguishes modules in shared memory; the id is for consumers that know modules by number.
pub const OUTSIDE_IDS: RangeInclusive<u32> = 1000..=9999;

/// Bytes of [`State::doing`].
pub const DOING_LEN: usize = 48;

crate::shared_struct! {
    /// State of a module. Service `<module>/state`, written at every change and at least once a second.
    pub struct State("module.State.v1") = 104 {
        /// Counts the samples of this publisher from 1.
        pub sequence: u64,
        /// When the publishing process began.
        pub epoch_ns: u64,
        /// When this was published.
        pub published_ns: u64,
        /// Since when `status` and `functionality` hold.
        pub since_ns: u64,
        /// Id of the module: below 1000 the robot's own, 1000 to 9999 others.
        pub module_id: u32,
        /// waiting-data-to-start 1, running 2, ended 3, aborted 4.
        pub status: u32 => status: ModuleStatus,
        /// Why a control request was refused, or why the module rests: 0 none, below 1000 as in module_state, from 1000 the
        /// module's own.
        pub error: u32,
        /// 1 when the module does not work until the next start.
        pub blocked: u32,
        /// What the module is doing, a number of its own; 0 is nothing.
        pub functionality: u32,
        /// 1 when what the module is doing cannot be stopped.
        pub unable_to_abort: u32,
        /// What the module is doing, in ASCII, filled up with zeros.
        pub doing: [u8; 48],
    }
}

impl State {
    /// The error that goes with it.
    pub const fn error(&self) -> ImiCode {
        ImiCode(self.error)
    }

    /// Whether the module does not work until the next start.
    pub const fn is_blocked(&self) -> bool {
        self.blocked != 0
    }

    /// What the module is doing; `None` if it is not text.
    pub fn doing(&self) -> Option<&str> {
        ascii_text(&self.doing)
    }
}

/// A text as it lies in [`State::doing`]: cut to its length, with `?` for what is not printable ASCII.
pub fn doing_bytes(text: &str) -> [u8; DOING_LEN] {
    ascii_bytes(text)
}

/// A module of the robot. [`module!`](crate::module!) implements it.
pub trait Module: 'static {
    /// Name in lower snake case, such as `battery_watch`: the first part of the keys of all its services.
    const NAME: &'static str;
    /// Id: one of [`OUTSIDE_IDS`], or of a module of the RIL's own a [`ModuleId`].
    const ID: u32;
    /// Key of the service with its state.
    const STATE_KEY: &'static str;
    /// Key of the service with its control requests.
    const CONTROL_KEY: &'static str;
}

/// The RIL's own module `status`, whose state is `status/state`.
#[derive(Clone, Copy, Debug)]
pub struct StatusModule;

impl Module for StatusModule {
    const NAME: &'static str = "status";
    const ID: u32 = ModuleId::HeroStatus.code();
    const STATE_KEY: &'static str = "status/state";
    const CONTROL_KEY: &'static str = "status/control";
}

impl StatusModule {
    /// [`State::functionality`]: no telemetry comes.
    pub const WAITING: u32 = 1;
    /// [`State::functionality`]: telemetry comes, and goes on in SI units.
    pub const TRANSLATING: u32 = 2;
}

/// The RIL's own module `relay`, whose state is `relay/state`.
///
/// It runs on either side of a link: its other topics are `relay/link` ([`RelayLink`](crate::payload::RelayLink)) on a
/// station's machine, and `relay/stations` ([`RelayStations`](crate::payload::RelayStations)) on a robot's and, carried
/// there, on a station's.
#[derive(Clone, Copy, Debug)]
pub struct RelayModule;

impl Module for RelayModule {
    const NAME: &'static str = "relay";
    const ID: u32 = ModuleId::HeroRelay.code();
    const STATE_KEY: &'static str = "relay/state";
    const CONTROL_KEY: &'static str = "relay/control";
}

impl RelayModule {
    /// [`State::functionality`]: there is no link to the other side.
    pub const WAITING: u32 = 1;
    /// [`State::functionality`]: there is a link, and samples and requests go over it.
    pub const RELAYING: u32 = 2;
}

/// Makes a type a [`Module`]: `module!(BatteryWatch, "battery_watch", 1001)`.
///
/// ```
/// struct BatteryWatch;
/// ipc_types::module!(BatteryWatch, "battery_watch", 1001);
///
/// use ipc_types::Topic;
/// use ipc_types::module::StateOf;
/// assert_eq!(StateOf::<BatteryWatch>::KEY, "battery_watch/state");
/// ```
///
/// The id is one of those for modules outside the RIL, and the name can be the first part of a key:
///
/// ```compile_fail
/// struct BatteryWatch;
/// ipc_types::module!(BatteryWatch, "battery_watch", 1);
/// ```
///
/// ```compile_fail
/// struct BatteryWatch;
/// ipc_types::module!(BatteryWatch, "BatteryWatch", 1001);
/// ```
///
/// It is none of the RIL's own:
///
/// ```compile_fail
/// struct BatteryWatch;
/// ipc_types::module!(BatteryWatch, "relay", 1001);
/// ```
#[macro_export]
macro_rules! module {
    ($module:ty, $name:literal, $id:expr) => {
        impl $crate::module::Module for $module {
            const NAME: &'static str = $name;
            const ID: u32 = $id;
            const STATE_KEY: &'static str = ::core::concat!($name, "/state");
            const CONTROL_KEY: &'static str = ::core::concat!($name, "/control");
        }

        const _: () = $crate::module::check::<$module>();
    };
}

/// Whether a module's name and id are such as they must be: for [`module!`](crate::module!).
#[doc(hidden)]
pub const fn check<M: Module>() {
    assert!(
        is_key(M::STATE_KEY) && is_key(M::CONTROL_KEY) && module_of(M::NAME).is_empty(),
        "a module's name is one word in lower snake case"
    );
    assert!(
        !is_own_name(M::NAME),
        "`bridge`, `status` and `relay` are the names of the RIL's own modules: choose another one"
    );
    assert!(
        M::ID >= *OUTSIDE_IDS.start() && M::ID <= *OUTSIDE_IDS.end(),
        "the id of a module outside the RIL is from 1000 to 9999"
    );
}

/// A struct of the contract as the module `M` publishes or serves it, under a key of its own.
#[repr(transparent)]
pub struct OfModule<M, T>(pub T, PhantomData<fn() -> M>);

/// The state of the module `M`, in its own topic.
pub type StateOf<M> = OfModule<M, State>;

/// A request to start or stop the module `M`, in its own service.
pub type ControlOf<M> = OfModule<M, ModuleControl>;

impl<M, T> OfModule<M, T> {
    /// What the module publishes or serves.
    pub const fn new(payload: T) -> Self {
        OfModule(payload, PhantomData)
    }
}

impl<M, T: Clone> Clone for OfModule<M, T> {
    fn clone(&self) -> Self {
        OfModule::new(self.0.clone())
    }
}

impl<M, T: Copy> Copy for OfModule<M, T> {}

impl<M, T: PartialEq> PartialEq for OfModule<M, T> {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

impl<M, T: Default> Default for OfModule<M, T> {
    fn default() -> Self {
        OfModule::new(T::default())
    }
}

impl<M, T: fmt::Debug> fmt::Debug for OfModule<M, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl<M, T> Deref for OfModule<M, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<M, T> DerefMut for OfModule<M, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.0
    }
}

impl<M, T: Serialize> Serialize for OfModule<M, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

// SAFETY: the type is a transparent wrapper of the struct, whose description is true of it.
unsafe impl<M: 'static, T: SharedStruct> SharedStruct for OfModule<M, T> {
    const LAYOUT: &'static Layout = T::LAYOUT;
    const ZERO: Self = OfModule::new(T::ZERO);
}

// SAFETY: as above; the name carries the version of the layout.
unsafe impl<M, T: SharedStruct + ZeroCopySend> ZeroCopySend for OfModule<M, T> {
    unsafe fn type_name() -> &'static str {
        T::TYPE_NAME
    }
}

impl<M: Module> ControlOf<M> {
    /// The request that asks the module for `command`, issued now.
    pub fn command(request_id: u64, command: ControlCommand) -> ControlOf<M> {
        ControlOf::new(ModuleControl::new(request_id, command))
    }
}

impl<M: Module> Topic for StateOf<M> {
    const KEY: &'static str = M::STATE_KEY;
    const PROVIDER: &'static str = M::NAME;
}

impl<M: Module> Request for ControlOf<M> {
    const KEY: &'static str = M::CONTROL_KEY;
    const PROVIDER: &'static str = M::NAME;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::Contract;

    struct Watch;
    crate::module!(Watch, "watch", 1000);

    #[test]
    fn a_module_has_two_services_under_its_name() {
        let state = Contract::of_topic::<StateOf<Watch>>();
        assert_eq!((state.key, state.provider), ("watch/state", "watch"));
        assert_eq!(state.layout(), "module.State.v1");
        let control = Contract::of_request::<ControlOf<Watch>>();
        assert_eq!((control.key, control.provider), ("watch/control", "watch"));
        let bridge = Contract::of_request::<ModuleControl>();
        assert_eq!(control.layout(), bridge.layout());
        assert_eq!(control.layout_hash(), bridge.layout_hash());
    }

    #[test]
    fn what_a_module_is_doing_is_cut_and_printable() {
        let state = |text: &str| State {
            doing: doing_bytes(text),
            ..State::default()
        };
        assert_eq!(state("watching").doing(), Some("watching"));
        assert_eq!(state("caf\u{e9}\n").doing(), Some("caf??"));
        assert_eq!(
            state(&"a".repeat(99)).doing().map(str::len),
            Some(DOING_LEN)
        );
    }
}
