//! The tables of `docs/protocol.md` say what the code does: groups, limits and ports.

use dsp_protocol::Group;
use dsp_protocol::port::{Access, PORTS_16, PORTS_32};

const CONTRACT: &str = include_str!("../../../docs/protocol.md");

/// The rows below each table header that begins with `header`, cut into cells.
fn rows(header: &str) -> Vec<Vec<String>> {
    let mut lines = CONTRACT.lines();
    let mut rows = Vec::new();
    while lines.by_ref().any(|line| line.starts_with(header)) {
        let table = lines.by_ref().skip(1);
        rows.extend(
            table
                .take_while(|line| line.starts_with('|'))
                .map(|line| line.trim_matches('|').split('|').map(cell).collect()),
        );
    }
    assert!(!rows.is_empty(), "no table {header}");
    rows
}

fn cell(text: &str) -> String {
    text.trim().replace('−', "-")
}

/// What stands in backticks.
fn quoted(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// A number with its unit, which may be empty.
fn quantity(cell: &str) -> (f64, &str) {
    let (number, unit) = cell.split_once(' ').unwrap_or((cell, ""));
    (number.parse().expect(cell), unit)
}

#[test]
fn the_groups_are_those_of_section_4_1() {
    let rows = rows("| bit | group |");
    assert_eq!(rows.len(), Group::ALL.len());
    for (row, group) in rows.iter().zip(Group::ALL) {
        let [bit, _, name, fields, types, bytes] = row.as_slice() else {
            panic!("{row:?}");
        };
        assert_eq!(bit.parse(), Ok(group as u8));
        assert_eq!(quoted(name), [group.name()]);
        assert_eq!(bytes.parse(), Ok(group.wire_len()), "{group:?}");
        let wires: Vec<&str> = group.limits().iter().map(|field| field.wire).collect();
        let mut types = quoted(types);
        let count = wires.len();
        if types.len() < count {
            // "each": the last type is that of all fields that follow.
            let last = types[types.len() - 1];
            types.resize(count, last);
        }
        assert_eq!(types, wires, "{group:?}: {fields}");
    }
}

#[test]
fn the_limits_are_those_of_section_9() {
    let mut limits: Vec<(String, Vec<_>)> = Vec::new();
    for row in rows("| group | field | least |") {
        let [group, fields, least, greatest] = row.as_slice() else {
            panic!("{row:?}");
        };
        if let [name] = quoted(group)[..] {
            limits.push((name.to_owned(), Vec::new()));
        }
        let count = match fields.as_str() {
            "all five" => 5,
            "raw ADC" => 1,
            fields => fields.split(", ").count(),
        };
        let ((min, unit), (max, _)) = (quantity(least), quantity(greatest));
        let (_, fields) = limits.last_mut().expect("a group");
        fields.extend((0..count).map(|_| (min, max, unit.to_owned())));
    }
    let stated: Vec<_> = Group::ALL
        .into_iter()
        .filter(|group| *group != Group::Time)
        .map(|group| {
            let fields = group.limits().iter();
            let limits = fields.map(|field| (field.min, field.max, field.unit.to_owned()));
            (group.name().to_owned(), limits.collect())
        })
        .collect();
    assert_eq!(limits, stated);
}

#[test]
fn the_ports_are_those_of_section_6() {
    let access = |access| match access {
        Access::Bridge => "bridge",
        Access::OnGround => "on ground",
        Access::Always => "always",
    };
    let stated: Vec<_> = PORTS_16
        .iter()
        .map(|port| {
            let range = (f64::from(port.min), f64::from(port.max));
            (
                port.number,
                port.name,
                access(port.access),
                range,
                f64::from(port.boot),
            )
        })
        .chain(PORTS_32.iter().map(|port| {
            let range = (f64::from(port.min), f64::from(port.max));
            (
                port.number,
                port.name,
                access(port.access),
                range,
                f64::from(port.boot),
            )
        }))
        .collect();
    let rows = rows("| port | name | who writes");
    let mut found = 0;
    for row in &rows {
        let [number, name, access, _, range, boot] = row.as_slice() else {
            panic!("{row:?}");
        };
        let [name] = quoted(name)[..] else {
            assert_eq!(access, "read only");
            continue;
        };
        let (number, name, access, (min, max), boot) = {
            let number: u16 = number.parse().expect(number);
            let range = match range.split(';').next().expect("a range") {
                "any" => (0.0, 65_535.0),
                "write 1" => (1.0, 1.0),
                range => {
                    let (min, max) = range.split_once(" … ").expect(range);
                    (quantity(min).0, quantity(max).0)
                }
            };
            (number, name, access, range, quantity(boot).0)
        };
        let port = &stated[found];
        assert_eq!((number, name, access.as_str()), (port.0, port.1, port.2));
        for (written, stated) in [(min, port.3.0), (max, port.3.1), (boot, port.4)] {
            assert!(
                (written - stated).abs() < 1e-6,
                "{name}: {written} and {stated}"
            );
        }
        found += 1;
    }
    assert_eq!(found, stated.len());
}
