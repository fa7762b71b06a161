//! `QGC WPL 110`: a header, and one item a line in twelve columns.
//!
//! ```text
//! INDEX CURRENT FRAME COMMAND PARAM1 PARAM2 PARAM3 PARAM4 LATITUDE LONGITUDE ALTITUDE AUTOCONTINUE
//! ```

use std::str::FromStr;

use super::items::push_mavlink;
use crate::error::ReadError;
use crate::format::PlanFormat;
use crate::mavlink::{FRAMES_SEA, MissionItem, command};
use crate::model::{LeftOut, OtherKind, Plan, PlannedHome, Position};

const COLUMNS: usize = 12;

pub fn read(text: &str) -> Result<Plan, ReadError> {
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (number, header) = lines
        .next()
        .ok_or_else(|| ReadError::file("there is no header `QGC WPL 110`"))?;
    check_header(header).map_err(|reason| ReadError::line(number, reason))?;

    let mut plan = Plan::empty(PlanFormat::WaypointList);
    let mut expected = None;
    for (number, line) in lines {
        let wrong = |reason| ReadError::line(number, reason);
        let (index, is_current, item) = parse(line).map_err(wrong)?;
        if expected.is_some_and(|expected| expected != index) {
            return Err(wrong(format!(
                "index {index}, but {} follows {}: a line is missing, or they are out of order",
                expected.unwrap_or_default(),
                expected.unwrap_or_default() - 1
            )));
        }
        let is_first = expected.is_none();
        // The first item is the current one in every list that no vehicle was flying.
        if is_current && !is_first && !plan.items.is_empty() {
            let what = format!(
                "line {number} is marked as the current item: the plan is flown from its beginning"
            );
            plan.left_out.push(LeftOut {
                what,
                kind: OtherKind::Payload,
            });
        }
        expected = Some(index + 1);
        if is_first && is_home(index, &item) {
            let home = home(&item).map_err(wrong)?;
            plan.planned_home = home;
            plan.left_out.push(LeftOut {
                what: format!(
                    "line {number}, the first item, is taken for the planned home, as ArduPilot's ground stations write it: it is \
                     not flown to"
                ),
                kind: OtherKind::Payload,
            });
        } else {
            push_mavlink(&mut plan, &format!("line {number}"), item)?;
        }
    }
    Ok(plan)
}

fn check_header(header: &str) -> Result<(), String> {
    match header.strip_prefix("QGC WPL").map(str::trim) {
        Some("110") => Ok(()),
        Some("120") => Err(
            "QGC WPL 120 keeps its home and its jumps in another way than 110; open it in QGroundControl and save it as .plan"
                .to_owned(),
        ),
        Some(version) => Err(format!("version `{version}` of QGC WPL; 110 is read")),
        None => Err("the header is not `QGC WPL 110`".to_owned()),
    }
}

/// The item with index 0 at an altitude above sea is the home of ArduPilot's ground stations.
fn is_home(index: u32, item: &MissionItem) -> bool {
    index == 0 && item.command == command::WAYPOINT && FRAMES_SEA.contains(&item.frame)
}

/// Nothing for 0, 0: the vehicle had none when the file was written.
fn home(item: &MissionItem) -> Result<Option<PlannedHome>, String> {
    let [.., latitude_deg, longitude_deg, above_sea_m] = item.params;
    if latitude_deg == 0.0 && longitude_deg == 0.0 {
        return Ok(None);
    }
    Ok(Some(PlannedHome {
        position: Position::new(latitude_deg, longitude_deg)?,
        above_sea_m: Some(above_sea_m).filter(|metres| metres.is_finite()),
    }))
}

/// The index of a line, whether it is the current one, and its item.
fn parse(line: &str) -> Result<(u32, bool, MissionItem), String> {
    let columns: Vec<&str> = line.split_whitespace().collect();
    if columns.len() != COLUMNS {
        return Err(format!("{} columns; an item has {COLUMNS}", columns.len()));
    }
    let mut params = [0.0_f64; 7];
    for (param, text) in params.iter_mut().zip(&columns[4..11]) {
        *param = number("a parameter", text)?;
        if param.is_infinite() {
            return Err(format!("a parameter `{text}` has no end"));
        }
    }
    let is_current = number::<u32>("current", columns[1])? != 0;
    let item = MissionItem {
        frame: number("the frame", columns[2])?,
        command: number("the command", columns[3])?,
        params,
        auto_continue: match columns[11] {
            "0" => false,
            "1" => true,
            other => {
                return Err(format!(
                    "autocontinue `{}` is neither 0 nor 1",
                    super::items::clean(other)
                ));
            }
        },
    };
    let index: u32 = number("the index", columns[0])?;
    // So that the next index is a number, too.
    match index < u32::MAX {
        true => Ok((index, is_current, item)),
        false => Err(format!("the index {index} is too large")),
    }
}

fn number<T: FromStr>(what: &str, text: &str) -> Result<T, String> {
    text.parse()
        .map_err(|_| format!("{what} `{}` is no such number", super::items::clean(text)))
}
