//! The names of all commands of the common dialect, and which part of a vehicle each is for.

/// Which part of a vehicle a command is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The flight, or that is not known.
    Flight,
    /// A camera, a gimbal or another load, the heading, or what is sent and kept: the path is the same without it.
    Payload,
}

/// MAV_CMD of the common dialect, by number, without `MAV_CMD_`, so that a finding can be understood.
#[rustfmt::skip]
pub const COMMANDS: [(u16, &str, Purpose); 171] = {
    use Purpose::{Flight, Payload};
    [
        (16, "NAV_WAYPOINT", Flight),
        (17, "NAV_LOITER_UNLIM", Flight),
        (18, "NAV_LOITER_TURNS", Flight),
        (19, "NAV_LOITER_TIME", Flight),
        (20, "NAV_RETURN_TO_LAUNCH", Flight),
        (21, "NAV_LAND", Flight),
        (22, "NAV_TAKEOFF", Flight),
        (23, "NAV_LAND_LOCAL", Flight),
        (24, "NAV_TAKEOFF_LOCAL", Flight),
        (25, "NAV_FOLLOW", Flight),
        (30, "NAV_CONTINUE_AND_CHANGE_ALT", Flight),
        (31, "NAV_LOITER_TO_ALT", Flight),
        (32, "DO_FOLLOW", Flight),
        (33, "DO_FOLLOW_REPOSITION", Flight),
        (34, "DO_ORBIT", Flight),
        (35, "DO_FIGURE_EIGHT", Flight),
        (36, "NAV_ARC_WAYPOINT", Flight),
        (80, "NAV_ROI", Payload),
        (81, "NAV_PATHPLANNING", Flight),
        (82, "NAV_SPLINE_WAYPOINT", Flight),
        (84, "NAV_VTOL_TAKEOFF", Flight),
        (85, "NAV_VTOL_LAND", Flight),
        (92, "NAV_GUIDED_ENABLE", Flight),
        (93, "NAV_DELAY", Flight),
        (94, "NAV_PAYLOAD_PLACE", Flight),
        (95, "NAV_LAST", Flight),
        (112, "CONDITION_DELAY", Flight),
        (113, "CONDITION_CHANGE_ALT", Flight),
        (114, "CONDITION_DISTANCE", Flight),
        (115, "CONDITION_YAW", Payload),
        (159, "CONDITION_LAST", Flight),
        (176, "DO_SET_MODE", Flight),
        (177, "DO_JUMP", Flight),
        (178, "DO_CHANGE_SPEED", Flight),
        (179, "DO_SET_HOME", Flight),
        (180, "DO_SET_PARAMETER", Flight),
        (181, "DO_SET_RELAY", Payload),
        (182, "DO_REPEAT_RELAY", Payload),
        (183, "DO_SET_SERVO", Payload),
        (184, "DO_REPEAT_SERVO", Payload),
        (185, "DO_FLIGHTTERMINATION", Flight),
        (186, "DO_CHANGE_ALTITUDE", Flight),
        (187, "DO_SET_ACTUATOR", Payload),
        (188, "DO_RETURN_PATH_START", Flight),
        (189, "DO_LAND_START", Flight),
        (190, "DO_RALLY_LAND", Flight),
        (191, "DO_GO_AROUND", Flight),
        (192, "DO_REPOSITION", Flight),
        (193, "DO_PAUSE_CONTINUE", Flight),
        (194, "DO_SET_REVERSE", Flight),
        (195, "DO_SET_ROI_LOCATION", Payload),
        (196, "DO_SET_ROI_WPNEXT_OFFSET", Payload),
        (197, "DO_SET_ROI_NONE", Payload),
        (198, "DO_SET_ROI_SYSID", Payload),
        (200, "DO_CONTROL_VIDEO", Payload),
        (201, "DO_SET_ROI", Payload),
        (202, "DO_DIGICAM_CONFIGURE", Payload),
        (203, "DO_DIGICAM_CONTROL", Payload),
        (204, "DO_MOUNT_CONFIGURE", Payload),
        (205, "DO_MOUNT_CONTROL", Payload),
        (206, "DO_SET_CAM_TRIGG_DIST", Payload),
        (207, "DO_FENCE_ENABLE", Flight),
        (208, "DO_PARACHUTE", Flight),
        (209, "DO_MOTOR_TEST", Flight),
        (210, "DO_INVERTED_FLIGHT", Flight),
        (211, "DO_GRIPPER", Payload),
        (212, "DO_AUTOTUNE_ENABLE", Flight),
        (213, "NAV_SET_YAW_SPEED", Flight),
        (214, "DO_SET_CAM_TRIGG_INTERVAL", Payload),
        (220, "DO_MOUNT_CONTROL_QUAT", Payload),
        (221, "DO_GUIDED_MASTER", Flight),
        (222, "DO_GUIDED_LIMITS", Flight),
        (223, "DO_ENGINE_CONTROL", Flight),
        (224, "DO_SET_MISSION_CURRENT", Flight),
        (240, "DO_LAST", Flight),
        (241, "PREFLIGHT_CALIBRATION", Flight),
        (242, "PREFLIGHT_SET_SENSOR_OFFSETS", Flight),
        (243, "PREFLIGHT_UAVCAN", Flight),
        (245, "PREFLIGHT_STORAGE", Flight),
        (246, "PREFLIGHT_REBOOT_SHUTDOWN", Flight),
        (252, "OVERRIDE_GOTO", Flight),
        (260, "OBLIQUE_SURVEY", Payload),
        (262, "DO_SET_STANDARD_MODE", Flight),
        (300, "MISSION_START", Flight),
        (310, "ACTUATOR_TEST", Flight),
        (311, "CONFIGURE_ACTUATOR", Flight),
        (400, "COMPONENT_ARM_DISARM", Flight),
        (401, "RUN_PREARM_CHECKS", Flight),
        (405, "ILLUMINATOR_ON_OFF", Payload),
        (406, "DO_ILLUMINATOR_CONFIGURE", Payload),
        (410, "GET_HOME_POSITION", Payload),
        (420, "INJECT_FAILURE", Flight),
        (500, "START_RX_PAIR", Flight),
        (510, "GET_MESSAGE_INTERVAL", Payload),
        (511, "SET_MESSAGE_INTERVAL", Payload),
        (512, "REQUEST_MESSAGE", Payload),
        (519, "REQUEST_PROTOCOL_VERSION", Payload),
        (520, "REQUEST_AUTOPILOT_CAPABILITIES", Payload),
        (521, "REQUEST_CAMERA_INFORMATION", Payload),
        (522, "REQUEST_CAMERA_SETTINGS", Payload),
        (525, "REQUEST_STORAGE_INFORMATION", Payload),
        (526, "STORAGE_FORMAT", Payload),
        (527, "REQUEST_CAMERA_CAPTURE_STATUS", Payload),
        (528, "REQUEST_FLIGHT_INFORMATION", Payload),
        (529, "RESET_CAMERA_SETTINGS", Payload),
        (530, "SET_CAMERA_MODE", Payload),
        (531, "SET_CAMERA_ZOOM", Payload),
        (532, "SET_CAMERA_FOCUS", Payload),
        (533, "SET_STORAGE_USAGE", Payload),
        (534, "SET_CAMERA_SOURCE", Payload),
        (600, "JUMP_TAG", Payload),
        (601, "DO_JUMP_TAG", Flight),
        (611, "DO_SET_GLOBAL_ORIGIN", Flight),
        (1000, "DO_GIMBAL_MANAGER_PITCHYAW", Payload),
        (1001, "DO_GIMBAL_MANAGER_CONFIGURE", Payload),
        (2000, "IMAGE_START_CAPTURE", Payload),
        (2001, "IMAGE_STOP_CAPTURE", Payload),
        (2002, "REQUEST_CAMERA_IMAGE_CAPTURE", Payload),
        (2003, "DO_TRIGGER_CONTROL", Payload),
        (2004, "CAMERA_TRACK_POINT", Payload),
        (2005, "CAMERA_TRACK_RECTANGLE", Payload),
        (2010, "CAMERA_STOP_TRACKING", Payload),
        (2500, "VIDEO_START_CAPTURE", Payload),
        (2501, "VIDEO_STOP_CAPTURE", Payload),
        (2502, "VIDEO_START_STREAMING", Payload),
        (2503, "VIDEO_STOP_STREAMING", Payload),
        (2504, "REQUEST_VIDEO_STREAM_INFORMATION", Payload),
        (2505, "REQUEST_VIDEO_STREAM_STATUS", Payload),
        (2510, "LOGGING_START", Payload),
        (2511, "LOGGING_STOP", Payload),
        (2520, "AIRFRAME_CONFIGURATION", Flight),
        (2600, "CONTROL_HIGH_LATENCY", Payload),
        (2800, "PANORAMA_CREATE", Payload),
        (3000, "DO_VTOL_TRANSITION", Flight),
        (3001, "ARM_AUTHORIZATION_REQUEST", Flight),
        (4000, "SET_GUIDED_SUBMODE_STANDARD", Flight),
        (4001, "SET_GUIDED_SUBMODE_CIRCLE", Flight),
        (4501, "CONDITION_GATE", Flight),
        (5000, "NAV_FENCE_RETURN_POINT", Flight),
        (5001, "NAV_FENCE_POLYGON_VERTEX_INCLUSION", Flight),
        (5002, "NAV_FENCE_POLYGON_VERTEX_EXCLUSION", Flight),
        (5003, "NAV_FENCE_CIRCLE_INCLUSION", Flight),
        (5004, "NAV_FENCE_CIRCLE_EXCLUSION", Flight),
        (5100, "NAV_RALLY_POINT", Flight),
        (5200, "UAVCAN_GET_NODE_INFO", Flight),
        (5300, "DO_SET_SAFETY_SWITCH_STATE", Flight),
        (10001, "DO_ADSB_OUT_IDENT", Payload),
        (30001, "PAYLOAD_PREPARE_DEPLOY", Flight),
        (30002, "PAYLOAD_CONTROL_DEPLOY", Payload),
        (31000, "WAYPOINT_USER_1", Flight),
        (31001, "WAYPOINT_USER_2", Flight),
        (31002, "WAYPOINT_USER_3", Flight),
        (31003, "WAYPOINT_USER_4", Flight),
        (31004, "WAYPOINT_USER_5", Flight),
        (31005, "SPATIAL_USER_1", Flight),
        (31006, "SPATIAL_USER_2", Flight),
        (31007, "SPATIAL_USER_3", Flight),
        (31008, "SPATIAL_USER_4", Flight),
        (31009, "SPATIAL_USER_5", Flight),
        (31010, "USER_1", Flight),
        (31011, "USER_2", Flight),
        (31012, "USER_3", Flight),
        (31013, "USER_4", Flight),
        (31014, "USER_5", Flight),
        (32000, "CAN_FORWARD", Flight),
        (42006, "FIXED_MAG_CAL_YAW", Flight),
        (42600, "DO_WINCH", Payload),
        (43000, "GUIDED_CHANGE_SPEED", Flight),
        (43001, "GUIDED_CHANGE_ALTITUDE", Flight),
        (43002, "GUIDED_CHANGE_HEADING", Flight),
        (43003, "EXTERNAL_POSITION_ESTIMATE", Flight),
    ]
};

/// What MAVLink calls a command, with its number.
pub fn command_name(command: u16) -> String {
    match known(command) {
        Some((name, _)) => format!("{name} ({command})"),
        None => format!("MAV_CMD {command}"),
    }
}

/// What a command is for.
pub fn purpose(command: u16) -> Purpose {
    known(command).map_or(Purpose::Flight, |(_, purpose)| purpose)
}

fn known(command: u16) -> Option<(&'static str, Purpose)> {
    COMMANDS
        .iter()
        .find(|(number, ..)| *number == command)
        .map(|(_, name, purpose)| (*name, *purpose))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_in_order_and_the_document_names_those_without_effect_on_the_flight() {
        assert!(COMMANDS.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!(command_name(1001), "DO_GIMBAL_MANAGER_CONFIGURE (1001)");
        assert_eq!(command_name(4242), "MAV_CMD 4242");
        let document = include_str!("../../../../docs/mavlink.md");
        let of_load = COMMANDS.iter().filter(|row| row.2 == Purpose::Payload);
        let names: Vec<&str> = of_load.map(|row| row.1).collect();
        let expected = names.join(", ");
        assert!(
            document.contains(&expected),
            "docs/mavlink.md should have:\n{expected}"
        );
    }
}
