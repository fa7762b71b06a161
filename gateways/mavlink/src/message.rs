//! The messages that are read and written.

/// A message of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageKind {
    /// Its number.
    pub id: u32,
    /// CRC_EXTRA: a checksum of its fields' names and types.
    pub extra: u8,
}

macro_rules! kinds {
    ($($(#[$meta:meta])* $name:ident = $id:literal, $extra:literal;)*) => {
        $($(#[$meta])* pub const $name: MessageKind = MessageKind { id: $id, extra: $extra };)*

        /// All of them.
        pub const ALL: &[MessageKind] = &[$($name),*];
    };
}

kinds! {
    /// A system is there.
    HEARTBEAT = 0, 50;
    /// Sensors, battery, errors.
    SYS_STATUS = 1, 124;
    /// Is a system there?
    PING = 4, 237;
    /// Sets the mode, without an answer.
    SET_MODE = 11, 89;
    /// Asks for a parameter.
    PARAM_REQUEST_READ = 20, 214;
    /// Asks for all parameters.
    PARAM_REQUEST_LIST = 21, 159;
    /// The value of a parameter.
    PARAM_VALUE = 22, 220;
    /// Sets a parameter.
    PARAM_SET = 23, 168;
    /// Satellites.
    GPS_RAW_INT = 24, 24;
    /// Angles and rates.
    ATTITUDE = 30, 39;
    /// Angles as a quaternion.
    ATTITUDE_QUATERNION = 31, 246;
    /// Place and velocity in metres.
    LOCAL_POSITION_NED = 32, 185;
    /// Place and velocity on the globe.
    GLOBAL_POSITION_INT = 33, 104;
    /// An item of a mission with places that a metre is lost of; it is answered and not taken.
    MISSION_ITEM = 39, 254;
    /// Asks for an item of a mission, in the old form.
    MISSION_REQUEST = 40, 230;
    /// Goes on with an item of a mission.
    MISSION_SET_CURRENT = 41, 28;
    /// Which item of the mission is flown.
    MISSION_CURRENT = 42, 28;
    /// Asks for the items of a mission.
    MISSION_REQUEST_LIST = 43, 132;
    /// How many items a mission has.
    MISSION_COUNT = 44, 221;
    /// Asks to forget a mission.
    MISSION_CLEAR_ALL = 45, 232;
    /// An item of the mission was done.
    MISSION_ITEM_REACHED = 46, 11;
    /// How the exchange of a mission ended.
    MISSION_ACK = 47, 153;
    /// Asks for an item of a mission.
    MISSION_REQUEST_INT = 51, 196;
    /// An item of a mission.
    MISSION_ITEM_INT = 73, 38;
    /// What a pilot looks at.
    VFR_HUD = 74, 20;
    /// A command with integer coordinates.
    COMMAND_INT = 75, 158;
    /// A command.
    COMMAND_LONG = 76, 152;
    /// The answer to a command.
    COMMAND_ACK = 77, 143;
    /// Files.
    FILE_TRANSFER_PROTOCOL = 110, 84;
    /// Asks for the clock.
    TIMESYNC = 111, 34;
    /// Altitudes.
    ALTITUDE = 141, 47;
    /// A battery.
    BATTERY_STATUS = 147, 154;
    /// What the vehicle can do.
    AUTOPILOT_VERSION = 148, 178;
    /// Where home is.
    HOME_POSITION = 242, 104;
    /// How often a message is sent.
    MESSAGE_INTERVAL = 244, 95;
    /// On the ground or in the air.
    EXTENDED_SYS_STATE = 245, 130;
    /// A text for people.
    STATUSTEXT = 253, 83;
    /// Why a parameter is not read or set.
    PARAM_ERROR = 345, 209;
    /// The fuel.
    FUEL_STATUS = 371, 10;
    /// The modes that there are.
    AVAILABLE_MODES = 435, 134;
    /// The mode that holds.
    CURRENT_MODE = 436, 193;
}

/// The message of this number, if it is read or written here.
pub fn kind(id: u32) -> Option<MessageKind> {
    ALL.iter().copied().find(|kind| kind.id == id)
}
