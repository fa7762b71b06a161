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

        impl MessageKind {
            /// What the protocol calls it.
            pub fn name(self) -> &'static str {
                let names = [$(($name, stringify!($name))),*];
                let named = names.into_iter().find(|(kind, _)| *kind == self);
                named.map_or("a message", |(_, name)| name)
            }
        }
    };
}

kinds! {
    /// A system is there.
    HEARTBEAT = 0, 50;
    /// Sensors, battery, errors.
    SYS_STATUS = 1, 124;
    /// Is a system there?
    PING = 4, 237;
    /// Asks to be the one that commands.
    CHANGE_OPERATOR_CONTROL = 5, 217;
    /// The answer to that.
    CHANGE_OPERATOR_CONTROL_ACK = 6, 104;
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
    /// Asks for some items of a mission.
    MISSION_REQUEST_PARTIAL_LIST = 37, 212;
    /// Some items of a mission will come.
    MISSION_WRITE_PARTIAL_LIST = 38, 9;
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
    /// Sets where local coordinates begin.
    SET_GPS_GLOBAL_ORIGIN = 48, 41;
    /// Lets a channel of the radio change a parameter.
    PARAM_MAP_RC = 50, 78;
    /// Asks for an item of a mission.
    MISSION_REQUEST_INT = 51, 196;
    /// Sets where the vehicle may be.
    SAFETY_SET_ALLOWED_AREA = 54, 15;
    /// Asks for groups of messages, in the old form.
    REQUEST_DATA_STREAM = 66, 148;
    /// A joystick.
    MANUAL_CONTROL = 69, 243;
    /// Channels of a radio.
    RC_CHANNELS_OVERRIDE = 70, 124;
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
    /// Takes a command back.
    COMMAND_CANCEL = 80, 14;
    /// A set point of the attitude.
    SET_ATTITUDE_TARGET = 82, 49;
    /// A set point in metres.
    SET_POSITION_TARGET_LOCAL_NED = 84, 143;
    /// A set point on the globe.
    SET_POSITION_TARGET_GLOBAL_INT = 86, 5;
    /// Files.
    FILE_TRANSFER_PROTOCOL = 110, 84;
    /// Asks for the clock.
    TIMESYNC = 111, 34;
    /// Asks which logs there are.
    LOG_REQUEST_LIST = 117, 128;
    /// A log.
    LOG_ENTRY = 118, 56;
    /// Asks for a part of a log.
    LOG_REQUEST_DATA = 119, 116;
    /// A part of a log.
    LOG_DATA = 120, 134;
    /// Asks to remove all logs.
    LOG_ERASE = 121, 237;
    /// Nothing more of a log is wanted.
    LOG_REQUEST_END = 122, 203;
    /// Corrections for a receiver.
    GPS_INJECT_DATA = 123, 250;
    /// Bytes for a shell or a port.
    SERIAL_CONTROL = 126, 220;
    /// A set point of the actuators.
    SET_ACTUATOR_CONTROL_TARGET = 139, 168;
    /// Altitudes.
    ALTITUDE = 141, 47;
    /// A battery.
    BATTERY_STATUS = 147, 154;
    /// What the vehicle can do.
    AUTOPILOT_VERSION = 148, 178;
    /// Where home is.
    HOME_POSITION = 242, 104;
    /// Sets home, in the old form.
    SET_HOME_POSITION = 243, 85;
    /// How often a message is sent.
    MESSAGE_INTERVAL = 244, 95;
    /// On the ground or in the air.
    EXTENDED_SYS_STATE = 245, 130;
    /// Bytes that others understand.
    V2_EXTENSION = 248, 8;
    /// A text for people.
    STATUSTEXT = 253, 83;
    /// Brings a key.
    SETUP_SIGNING = 256, 71;
    /// Asks for a melody.
    PLAY_TUNE = 258, 187;
    /// A set point of a gimbal.
    GIMBAL_MANAGER_SET_ATTITUDE = 282, 123;
    /// A set point of a gimbal itself.
    GIMBAL_DEVICE_SET_ATTITUDE = 284, 99;
    /// A set point of a gimbal, by two angles.
    GIMBAL_MANAGER_SET_PITCHYAW = 287, 1;
    /// A joystick of a gimbal.
    GIMBAL_MANAGER_SET_MANUAL_CONTROL = 288, 20;
    /// Asks for a parameter of a camera.
    PARAM_EXT_REQUEST_READ = 320, 243;
    /// Asks for all parameters of a camera.
    PARAM_EXT_REQUEST_LIST = 321, 88;
    /// Sets a parameter of a camera.
    PARAM_EXT_SET = 323, 78;
    /// The answer to that.
    PARAM_EXT_ACK = 324, 132;
    /// Why a parameter is not read or set.
    PARAM_ERROR = 345, 209;
    /// The fuel.
    FUEL_STATUS = 371, 10;
    /// Bytes for a payload.
    TUNNEL = 385, 147;
    /// A frame for a CAN bus.
    CAN_FRAME = 386, 132;
    /// A frame for a CAN FD bus.
    CANFD_FRAME = 387, 4;
    /// Which frames of a CAN bus are wanted.
    CAN_FILTER_MODIFY = 388, 8;
    /// Asks for a melody, in the new form.
    PLAY_TUNE_V2 = 400, 110;
    /// Asks for events again.
    REQUEST_EVENT = 412, 33;
    /// The answer to that.
    RESPONSE_EVENT_ERROR = 413, 77;
    /// The modes that there are.
    AVAILABLE_MODES = 435, 134;
    /// The mode that holds.
    CURRENT_MODE = 436, 193;
}

/// The message of this number, if it is read or written here.
pub fn kind(id: u32) -> Option<MessageKind> {
    ALL.iter().copied().find(|kind| kind.id == id)
}
