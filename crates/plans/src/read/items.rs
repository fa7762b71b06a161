//! The items of a plan while it is read: numbered, and bounded.

use crate::error::{MAX_AREAS, MAX_ITEMS, MAX_NAME_CHARS, MAX_REASON_CHARS, ReadError};
use crate::format::PlanFormat;
use crate::mavlink::MissionItem;
use crate::meaning::Meaning;
use crate::model::{Action, FenceArea, Ignored, Item, Plan};

impl Plan {
    /// The plan of these mission items, as if QGroundControl had saved them: they are numbered from 1, in order.
    ///
    /// # Errors
    ///
    /// The first item that cannot be read, by its number, and why: a coordinate that is none. Also more than
    /// [`MAX_ITEMS`].
    pub fn from_items(items: impl IntoIterator<Item = MissionItem>) -> Result<Plan, ReadError> {
        let mut plan = Plan::empty(PlanFormat::QgcPlan);
        for item in items {
            let origin = format!("item {}", plan.items.len() + 1);
            push_mavlink(&mut plan, &origin, item)?;
        }
        Ok(plan)
    }
}

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
    ignored: Vec<Ignored>,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mission_items_are_a_plan_as_a_file_with_them_is() {
        let list = "QGC WPL 110\n1 0 3 22 0 0 0 0 0 0 15 1\n2 0 3 16 0 2 0 0 37.4113 -6.001 18 0\n3 0 2 178 1 4 -1 0 0 0 0 1\n";
        let read = crate::read("a.waypoints".as_ref(), list.as_bytes()).unwrap();
        let items: Vec<MissionItem> = read.items.iter().filter_map(|item| item.mavlink).collect();
        let plan = Plan::from_items(items.clone()).unwrap();
        assert_eq!(plan.items.len(), 3);
        for (index, (item, of_file)) in plan.items.iter().zip(&read.items).enumerate() {
            assert_eq!(item.origin, format!("item {}", index + 1));
            let origin = of_file.origin.clone();
            assert_eq!(
                Item {
                    origin,
                    ..item.clone()
                },
                *of_file
            );
        }
        let mut wrong = items;
        wrong[1].params[4] = 91.0;
        let error = Plan::from_items(wrong).unwrap_err().to_string();
        assert!(error.starts_with("item 2: the latitude 91"), "{error}");
        let too_many = std::iter::repeat_n(plan.items[0].mavlink.unwrap(), MAX_ITEMS + 1);
        assert!(Plan::from_items(too_many).is_err());
    }
}
