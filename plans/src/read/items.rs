//! The items of a plan while it is read: numbered, and bounded.

use crate::error::{MAX_AREAS, MAX_ITEMS, MAX_NAME_CHARS, MAX_REASON_CHARS, ReadError};
use crate::mavlink::MissionItem;
use crate::meaning::Meaning;
use crate::model::{Action, FenceArea, Item, Plan};

/// A name as it is kept: without control characters, which could harm a terminal, and not too long.
pub fn clean(name: &str) -> String {
    let printable = name.trim().chars().filter(|letter| !letter.is_control());
    printable.take(MAX_NAME_CHARS).collect()
}

/// A reason of another library, which may repeat what the file has: without control characters, and not too long.
pub fn clean_reason(reason: &str) -> String {
    let printable = reason.chars().filter(|letter| !letter.is_control());
    printable.take(MAX_REASON_CHARS).collect()
}

/// Adds an item that stands at `origin` of the file.
pub fn push(plan: &mut Plan, origin: &str, label: &str, action: Action) -> Result<(), ReadError> {
    add(plan, origin, label, action, Vec::new(), None)
}

/// Adds an item of MAVLink.
pub fn push_mavlink(plan: &mut Plan, origin: &str, mavlink: MissionItem) -> Result<(), ReadError> {
    let meaning = Meaning::of(&mavlink).map_err(|reason| ReadError::part(origin, reason))?;
    add(
        plan,
        origin,
        "",
        meaning.action,
        meaning.ignored,
        Some(mavlink),
    )
}

fn add(
    plan: &mut Plan,
    origin: &str,
    label: &str,
    action: Action,
    ignored: Vec<String>,
    mavlink: Option<MissionItem>,
) -> Result<(), ReadError> {
    if plan.items.len() == MAX_ITEMS {
        return Err(ReadError::too_many_items());
    }
    plan.items.push(Item {
        number: plan.items.len() as u32 + 1,
        origin: origin.to_owned(),
        label: clean(label),
        action,
        ignored,
        mavlink,
    });
    Ok(())
}

/// Adds an area of the fence. Without a name it is called by its kind and its number.
pub fn push_area(plan: &mut Plan, area: FenceArea) -> Result<(), ReadError> {
    if plan.fence.len() == MAX_AREAS {
        return Err(ReadError::new(format!("more than {MAX_AREAS} fence areas")));
    }
    let name = clean(&area.name);
    let kind = match area.is_inclusion {
        true => "inclusion",
        false => "exclusion",
    };
    let name = match name.is_empty() || plan.fence.iter().any(|other| other.name == name) {
        true => format!("{kind} {}", plan.fence.len() + 1),
        false => name,
    };
    plan.fence.push(FenceArea { name, ..area });
    Ok(())
}
