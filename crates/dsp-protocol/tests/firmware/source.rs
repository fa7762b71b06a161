//! The parts of `bindings/firmware/hero_dsp.{h,c}` that are made from this crate's tables: numbers, structs, and the
//! code of the groups.
//!
//! They are pinned: after a change of a table, write them anew with
//! `RIL_WRITE_LAYOUTS=1 cargo test -p dsp-protocol --test main firmware::`.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use dsp_protocol::port::{self, PORTS_16, PORTS_32};
use dsp_protocol::{
    DecodeError, DspErrorCode, FieldSpec, Group, MAX_CLASSIC_FRAME_LEN, MAX_FRAME_LEN, StatusMask,
    header,
};

const BEGIN: &str = "/* made: crates/dsp-protocol/tests/firmware writes it */\n";
const END: &str = "/* end of what is made */\n";

/// The names that the errors of section 7 have in C; every known code needs one.
const ERRORS: [(u16, &str); 26] = [
    (1, "SCI_A_RECEIVE_FULL"),
    (2, "SCI_B_RECEIVE_FULL"),
    (3, "SCI_A_READ_EMPTY"),
    (4, "SCI_B_READ_EMPTY"),
    (5, "SCI_A_WRITE_FULL"),
    (6, "SCI_B_WRITE_FULL"),
    (7, "SCI_PORT"),
    (8, "PWM_WRITE"),
    (9, "UART_NUMBER"),
    (10, "UART_1_RECEIVE_FULL"),
    (11, "UART_2_RECEIVE_FULL"),
    (12, "UART_1_FRAMING"),
    (13, "UART_2_FRAMING"),
    (14, "UART_QUEUE_EMPTY"),
    (15, "UART_QUEUE_FULL"),
    (18, "SCHEDULER"),
    (20, "READ_ROUTINE"),
    (21, "WRITE_ROUTINE"),
    (22, "INTERRUPT_ROUTINE"),
    (30, "INVALID_COMMAND"),
    (40, "IMU_CHECKSUM"),
    (45, "GPS_CRC"),
    (46, "GPS_STATE"),
    (100, "UNKNOWN_HEADER"),
    (102, "PC_CHECKSUM"),
    (300, "RADIO_CHECKSUM"),
];

const HEADERS: [(&str, u8, &str); 10] = [
    ("STATUS", header::STATUS, "DSP to PC"),
    ("FLOW_CONTROL", header::FLOW_CONTROL, "DSP to PC"),
    ("ACK", header::ACK, "DSP to PC, without a value"),
    ("ACK_16", header::ACK_16, "DSP to PC, with 16 bits"),
    ("ACK_32", header::ACK_32, "DSP to PC, with 32 bits"),
    ("ERROR", header::ERROR, "DSP to PC"),
    ("COMMAND", header::COMMAND, "PC to DSP"),
    ("WAYPOINT", header::WAYPOINT, "PC to DSP"),
    (
        "EXTENDED_DOWNLINK",
        header::EXTENDED_DOWNLINK,
        "DSP to PC, every message of the extended profile",
    ),
    (
        "EXTENDED_UPLINK",
        header::EXTENDED_UPLINK,
        "PC to DSP, every message of the extended profile",
    ),
];

const COMMANDS: [&str; 8] = [
    "READ_16",
    "WRITE_16",
    "READ_32",
    "WRITE_32",
    "CLEAR_ERRORS",
    "ACTIVATE_STATUS",
    "INVALIDATE_PATH",
    "FOLLOWING",
];

/// A path below `bindings/firmware`.
pub fn path(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../bindings/firmware")
        .join(file)
}

/// The field's name in C: what counts steps of another unit than the name says gets the name of that unit.
pub fn c_name(field: &FieldSpec) -> String {
    const UNITS: [(&str, u32, &str); 6] = [
        ("_deg", 10_000_000, "_deg_e7"),
        ("_deg", 100, "_cdeg"),
        ("_mps2", 100, "_cmps2"),
        ("_mps", 100, "_cmps"),
        ("_radps", 1000, "_mradps"),
        ("_m", 1000, "_mm"),
    ];
    if field.steps_per_unit == 1 {
        return field.name.to_owned();
    }
    let unit = UNITS
        .iter()
        .find(|(unit, steps, _)| field.name.ends_with(unit) && field.steps_per_unit == *steps);
    let (unit, _, steps) = unit.unwrap_or_else(|| panic!("name the steps of {field:?}"));
    field.name.strip_suffix(unit).unwrap().to_owned() + steps
}

/// Where the field lies in `hero_dsp_status`: a group with one field has no struct.
pub fn c_place(group: Group, field: &FieldSpec) -> String {
    match group.limits() {
        [_] => c_name(field),
        _ => format!("{}.{}", group.name(), c_name(field)),
    }
}

fn c_type(wire: &str) -> &'static str {
    match wire {
        "u7" => "hero_dsp_byte",
        "u14" | "u16" => "uint16_t",
        "i16" => "int16_t",
        "u32" => "uint32_t",
        "i32" => "int32_t",
        other => panic!("no C type for {other}"),
    }
}

/// The ends of a wire type.
pub fn range(wire: &str) -> (i64, i64) {
    match wire {
        "u7" => (0, 0x7F),
        "u14" => (0, 0x3FFF),
        "u16" => (0, u16::MAX.into()),
        "i16" => (i16::MIN.into(), i16::MAX.into()),
        "u32" => (0, u32::MAX.into()),
        "i32" => (i32::MIN.into(), i32::MAX.into()),
        other => panic!("no range of {other}"),
    }
}

/// The limits of section 9 in steps.
fn limits(field: &FieldSpec) -> (i64, i64) {
    let steps = |limit: f64| (limit * f64::from(field.steps_per_unit)).round() as i64;
    (steps(field.min), steps(field.max))
}

fn ascii(text: &str) -> String {
    let text = text.replace('°', "deg").replace('µ', "u").replace('²', "2");
    assert!(text.is_ascii(), "{text}");
    text
}

fn field_comment(field: &FieldSpec) -> String {
    let (least, greatest) = limits(field);
    let unit = match (field.steps_per_unit, ascii(field.unit)) {
        (1, unit) if unit.is_empty() => String::new(),
        (1, unit) => format!("{unit}, "),
        (steps, unit) => format!("1/{steps} {unit}, "),
    };
    format!("/* {unit}{least} ... {greatest} */")
}

fn upper(name: &str) -> String {
    name.to_uppercase()
}

fn define(text: &mut String, name: &str, value: &str, comment: &str) {
    let comment = match comment.is_empty() {
        true => String::new(),
        false => format!(" /* {comment} */"),
    };
    writeln!(text, "#define HERO_DSP_{name} {value}{comment}").unwrap();
}

fn numbers() -> String {
    let mut text =
        String::from("/* Headers (2). The classic header names a message in both profiles. */\n");
    for (name, header, what) in HEADERS {
        define(&mut text, name, &format!("0x{header:02X}u"), what);
    }
    text.push_str("\n/* The longest frames, in bytes: a status with all groups. */\n");
    let classic = format!("{MAX_CLASSIC_FRAME_LEN}u");
    define(&mut text, "MAX_CLASSIC_FRAME_LEN", &classic, "");
    define(&mut text, "MAX_FRAME_LEN", &format!("{MAX_FRAME_LEN}u"), "");
    text.push_str("\n/* Codes of the commands (5.1). */\ntypedef enum {\n");
    for (code, name) in COMMANDS.iter().enumerate() {
        let comma = if code + 1 < COMMANDS.len() { "," } else { "" };
        writeln!(text, "    HERO_DSP_{name} = {code}{comma}").unwrap();
    }
    text.push_str("} hero_dsp_command_code;\n\n");
    text.push_str(
        "/* What bytes gave: a message, or why they were discarded (2, 11). */\ntypedef enum {\n",
    );
    text.push_str("    HERO_DSP_INCOMPLETE = 0,\n    HERO_DSP_MESSAGE = 1");
    for (number, error) in (2..).zip(DecodeError::ALL) {
        write!(text, ",\n    HERO_DSP_{} = {number}", upper(error.name())).unwrap();
    }
    text.push_str("\n} hero_dsp_result;\n\n/* Errors that the DSP reports (7). */\ntypedef enum {");
    for (at, code) in DspErrorCode::KNOWN.into_iter().enumerate() {
        let (number, name) = ERRORS[at];
        assert_eq!(number, code.0, "name the error in C");
        let comma = if at + 1 < ERRORS.len() { "," } else { "" };
        let what = code.text();
        write!(
            text,
            "\n    HERO_DSP_ERROR_{name} = {number}{comma} /* {what} */"
        )
        .unwrap();
    }
    text.push_str("\n} hero_dsp_error;\n");
    text
}

fn ports() -> String {
    let mut text = String::from("\n/* Virtual ports (6). */\n");
    let count = (port::WAYPOINT_COUNT, "waypoint_count", "16 bits, read only");
    let of_16 = PORTS_16
        .iter()
        .map(|port| (port.number, port.name, "16 bits"));
    let of_32 = PORTS_32
        .iter()
        .map(|port| (port.number, port.name, "32 bits"));
    let mut all: Vec<_> = of_16.chain(of_32).chain([count]).collect();
    all.sort_unstable();
    for (number, name, width) in all {
        let name = format!("PORT_{}", upper(name));
        define(&mut text, &name, &format!("{number}u"), width);
    }
    text.push_str(
        "\n/* The ports that may be written, ascending: without HERO_DSP_PORT_WAYPOINT_COUNT. */\n",
    );
    define(&mut text, "PORTS_16", &format!("{}u", PORTS_16.len()), "");
    define(&mut text, "PORTS_32", &format!("{}u", PORTS_32.len()), "");
    text.push_str("extern const hero_dsp_port16 hero_dsp_ports16[HERO_DSP_PORTS_16];\n");
    text.push_str("extern const hero_dsp_port32 hero_dsp_ports32[HERO_DSP_PORTS_32];\n");
    text
}

fn structs() -> String {
    let mut text = String::from("\n/* Groups of a status (4.1): bits of its mask. */\n");
    for group in Group::ALL {
        let name = format!("GROUP_{}", upper(group.name()));
        define(&mut text, &name, &format!("0x{:04X}u", group.bit()), "");
    }
    define(
        &mut text,
        "GROUP_ALL",
        &format!("0x{:04X}u", StatusMask::ALL.0),
        "",
    );
    text.push_str(
        "\n/* The groups as they are on the line, in whole steps: `_deg_e7` counts 1/10000000 deg, `_cdeg` 1/100 deg, `_cmps` cm/s. A comment\n\
         \x20* gives the step and the limits of section 9. */\n",
    );
    for group in Group::ALL {
        let fields = group.limits();
        if fields.len() > 1 {
            text.push_str("typedef struct {\n");
            for field in fields {
                let (kind, name, comment) =
                    (c_type(field.wire), c_name(field), field_comment(field));
                writeln!(text, "    {kind} {name}; {comment}").unwrap();
            }
            writeln!(text, "}} hero_dsp_{};\n", group.name()).unwrap();
        }
    }
    text.push_str("/* A status: the flying flag, and the groups of its mask. The others are not sent and not changed. */\n");
    text.push_str(
        "typedef struct {\n    uint16_t mask; /* HERO_DSP_GROUP_... */\n    bool flying;\n",
    );
    for group in Group::ALL {
        match group.limits() {
            [field] => {
                let (kind, name, comment) =
                    (c_type(field.wire), c_name(field), field_comment(field));
                writeln!(text, "    {kind} {name}; {comment}").unwrap();
            }
            _ => writeln!(text, "    hero_dsp_{0} {0};", group.name()).unwrap(),
        }
    }
    text.push_str("} hero_dsp_status;\n");
    text
}

/// Whether values of `place` lie within the limits, as far as their type does not see to it.
fn comparisons(field: &FieldSpec, place: &str) -> Vec<String> {
    let ((least, greatest), (min, max)) = (limits(field), range(field.wire));
    // A `u7` and a `u14` have room for more than their type on the wire.
    let max = match field.wire {
        "u7" | "u14" => i64::MAX,
        _ => max,
    };
    let suffix = if min == 0 { "u" } else { "" };
    let mut found = Vec::new();
    if least > min {
        found.push(format!("({place} >= {least}{suffix})"));
    }
    if greatest < max {
        found.push(format!("({place} <= {greatest}{suffix})"));
    }
    found
}

fn group_code(group: Group) -> String {
    let (name, fields) = (group.name(), group.limits());
    let mut text = String::new();
    writeln!(
        text,
        "static void write_{name}(writer *out, const hero_dsp_{name} *group)\n{{"
    )
    .unwrap();
    for field in fields {
        writeln!(
            text,
            "    put_{}(out, group->{});",
            field.wire,
            c_name(field)
        )
        .unwrap();
    }
    writeln!(
        text,
        "}}\n\nstatic void read_{name}(reader *in, hero_dsp_{name} *group)\n{{"
    )
    .unwrap();
    for field in fields {
        writeln!(
            text,
            "    group->{} = take_{}(in);",
            c_name(field),
            field.wire
        )
        .unwrap();
    }
    writeln!(
        text,
        "}}\n\nstatic bool is_plausible_{name}(const hero_dsp_{name} *group)\n{{"
    )
    .unwrap();
    let all: Vec<_> = fields
        .iter()
        .flat_map(|field| comparisons(field, &format!("group->{}", c_name(field))))
        .collect();
    writeln!(text, "    return {};\n}}\n", all.join(" &&\n           ")).unwrap();
    text
}

/// A function over all groups of a status: `each` gives the statement for a group.
fn over_groups(head: &str, each: impl Fn(Group) -> Option<String>) -> String {
    let mut text = format!("{head}\n{{\n");
    for group in Group::ALL {
        if let Some(statement) = each(group) {
            let bit = format!("HERO_DSP_GROUP_{}", upper(group.name()));
            writeln!(
                text,
                "    if ((status->mask & {bit}) != 0u) {{\n{statement}    }}"
            )
            .unwrap();
        }
    }
    text
}

fn code() -> String {
    let mut text = String::from("/* Bytes of each group on the line. */\n");
    for group in Group::ALL {
        let name = upper(group.name());
        writeln!(text, "#define {name}_LEN {}u", group.wire_len()).unwrap();
    }
    text.push_str("\nstatic const hero_dsp_byte GROUP_LEN[GROUPS] = {\n");
    for group in Group::ALL {
        writeln!(text, "    {}_LEN,", upper(group.name())).unwrap();
    }
    text.push_str("};\n\nconst hero_dsp_port16 hero_dsp_ports16[HERO_DSP_PORTS_16] = {\n");
    for port in PORTS_16 {
        let (name, signed) = (upper(port.name), port.signed);
        let (min, max, boot) = (port.min, port.max, port.boot);
        writeln!(
            text,
            "    {{HERO_DSP_PORT_{name}, {signed}, {min}, {max}, {boot}}},"
        )
        .unwrap();
    }
    text.push_str("};\n\nconst hero_dsp_port32 hero_dsp_ports32[HERO_DSP_PORTS_32] = {\n");
    for port in PORTS_32 {
        let (name, min, max, boot) = (upper(port.name), port.min, port.max, port.boot);
        writeln!(
            text,
            "    {{HERO_DSP_PORT_{name}, {min:?}f, {max:?}f, {boot:?}f}},"
        )
        .unwrap();
    }
    text.push_str("};\n\n");
    for group in Group::ALL
        .into_iter()
        .filter(|group| group.limits().len() > 1)
    {
        text.push_str(&group_code(group));
    }
    let head = "static void write_groups(writer *out, const hero_dsp_status *status)";
    text.push_str(&over_groups(head, |group| {
        let name = group.name();
        Some(match group.limits() {
            [field] => format!(
                "        put_{}(out, status->{});\n",
                field.wire,
                c_name(field)
            ),
            _ => format!("        write_{name}(out, &status->{name});\n"),
        })
    }));
    text.push_str("}\n\n");
    let head = "static void read_groups(reader *in, hero_dsp_status *status)";
    text.push_str(&over_groups(head, |group| {
        let name = group.name();
        Some(match group.limits() {
            [field] => format!(
                "        status->{} = take_{}(in);\n",
                c_name(field),
                field.wire
            ),
            _ => format!("        read_{name}(in, &status->{name});\n"),
        })
    }));
    text.push_str("}\n\n");
    let head = "uint16_t hero_dsp_implausible_groups(const hero_dsp_status *status)";
    let body = over_groups(head, |group| {
        let name = group.name();
        let test = match group.limits() {
            [field] => {
                let all = comparisons(field, &format!("status->{}", c_name(field)));
                // Every value of the type is plausible.
                (!all.is_empty()).then(|| all.join(" && "))?
            }
            _ => format!("is_plausible_{name}(&status->{name})"),
        };
        let bit = format!("HERO_DSP_GROUP_{}", upper(name));
        Some(format!("        implausible |= ({test}) ? 0u : {bit};\n"))
    });
    let body = body.replacen("{\n", "{\n    uint32_t implausible = 0u;\n", 1);
    text.push_str(&body);
    text.push_str("    return (uint16_t)implausible;\n}\n");
    text
}

/// The file with `made` between its two lines.
fn with(file: &str, made: &str) -> String {
    let (before, rest) = file.split_once(BEGIN).expect("the line where it begins");
    let (_, after) = rest.split_once(END).expect("the line where it ends");
    format!("{before}{BEGIN}{made}{END}{after}")
}

fn check(file: &str, made: &str) {
    let path = path(file);
    let pinned = fs::read_to_string(&path).expect("a file of the repository");
    let made = with(&pinned, made);
    if std::env::var_os("RIL_WRITE_LAYOUTS").is_some() {
        fs::write(&path, &made).expect("a file that can be written");
        return;
    }
    let mut lines = made
        .lines()
        .zip(pinned.lines().chain(std::iter::repeat("")));
    let difference = lines.find(|(made, pinned)| made != pinned);
    assert!(
        made == pinned,
        "{file} is not what the tables say: write it anew (see the top of tests/firmware/source.rs). First difference, \
         now and pinned: {difference:?}"
    );
}

#[test]
fn the_header_is_that_of_the_tables() {
    check("hero_dsp.h", &[numbers(), ports(), structs()].concat());
}

#[test]
fn the_source_is_that_of_the_tables() {
    check("hero_dsp.c", &code());
}

#[test]
fn files_that_are_not_what_the_tables_say_are_found() {
    let file = format!("before\n{BEGIN}old\n{END}after\n");
    assert_eq!(
        with(&file, "new\n"),
        format!("before\n{BEGIN}new\n{END}after\n")
    );
}
