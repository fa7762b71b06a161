//! The fence of plans and ground stations in the bridge's configuration file.
//!
//! Only areas whose names begin with `PREFIX` are changed: those of the plan before go, those of this plan come. The
//! fence never becomes wider: inclusion areas are one area together, so a plan's inclusions are refused beside those of
//! the operator.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use bridge::BridgeConfig;
use plans::check::area_config;
use plans::model::FenceArea;
use runtime::config::ConfigError;
use runtime::durable;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, value};

/// How the names of a plan's areas begin.
const PREFIX: &str = "plan: ";

/// Why the file was not changed.
#[derive(Debug, thiserror::Error)]
pub enum FenceFileError {
    /// It is not there, or not for this user.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// It would make the fence wider, or has no place for areas.
    #[error("{}: {why}", path.display())]
    Refused {
        /// Which file.
        path: PathBuf,
        /// Why, as a clause.
        why: String,
    },
    /// With these areas it is no configuration of a bridge.
    #[error(transparent)]
    Configuration(#[from] ConfigError),
    /// It cannot be replaced.
    #[error("{} cannot be written: {source}", path.display())]
    Write {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// Somebody else has changed it, so that what it was before is not written over it.
    #[error("{} was changed meanwhile: look whether the areas that begin with `plan: ` are wanted", path.display())]
    Changed {
        /// Which file.
        path: PathBuf,
    },
}

impl FenceFileError {
    /// Whether this user may not replace the file: the folder or the service forbids it.
    pub fn is_forbidden(&self) -> bool {
        let FenceFileError::Write { source, .. } = self else {
            return false;
        };
        matches!(
            source.kind(),
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem
        )
    }
}

/// A change of the bridge's configuration file, which can be taken back.
#[derive(Debug)]
pub struct FenceChange {
    path: PathBuf,
    before: String,
    after: String,
    /// How many areas the file has now.
    pub areas: usize,
}

impl FenceChange {
    /// Puts the areas into the file in place of those of an earlier plan or station. It waits for the disk,
    /// milliseconds as a rule.
    ///
    /// # Errors
    ///
    /// Why the file is as before.
    pub fn put(path: &Path, areas: &[FenceArea]) -> Result<FenceChange, FenceFileError> {
        let own = || path.to_owned();
        let before = fs::read_to_string(path).map_err(|source| FenceFileError::Read {
            path: own(),
            source,
        })?;
        let after = with_areas(&before, areas)
            .map_err(|why| FenceFileError::Refused { path: own(), why })?;
        let config: BridgeConfig = runtime::config::parse(&after, path.display().to_string())?;
        durable::replace(path, after.as_bytes()).map_err(|source| FenceFileError::Write {
            path: own(),
            source,
        })?;
        Ok(FenceChange {
            path: own(),
            before,
            after,
            areas: config.fence.areas(),
        })
    }

    /// Makes the file what it was before, unless another program has changed it since.
    ///
    /// # Errors
    ///
    /// Why it is not what it was.
    pub fn take_back(self) -> Result<(), FenceFileError> {
        let FenceChange {
            path,
            before,
            after,
            ..
        } = self;
        match fs::read_to_string(&path) {
            Ok(text) if text == after => durable::replace(&path, before.as_bytes())
                .map_err(|source| FenceFileError::Write { path, source }),
            Ok(_) => Err(FenceFileError::Changed { path }),
            Err(source) => Err(FenceFileError::Read { path, source }),
        }
    }
}

/// The configuration `text` with these areas in place of those of an earlier plan.
fn with_areas(text: &str, areas: &[FenceArea]) -> Result<String, String> {
    let mut document: DocumentMut = text.parse().map_err(|error| format!("{error}"))?;
    let fence = document
        .entry("fence")
        .or_insert_with(|| Item::Table(Table::new()))
        .as_table_mut()
        .ok_or("`fence` is no table; write it as [fence]")?;
    let tables = fence
        .entry("area")
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()))
        .as_array_of_tables_mut()
        .ok_or("`fence.area` is no list of tables; write its areas as [[fence.area]]")?;
    let text_of =
        |table: &Table, key: &str| table.get(key).and_then(Item::as_str).map(str::to_owned);
    tables.retain(|table| !text_of(table, "name").is_some_and(|name| name.starts_with(PREFIX)));
    let has_inclusion = tables
        .iter()
        .any(|table| text_of(table, "kind").as_deref() == Some("inclusion"));
    if has_inclusion && areas.iter().any(|area| area.is_inclusion) {
        return Err(
            "it has inclusion areas, and those of the plan would make the fence wider; the plan was checked against both, so fly it \
             without --fence"
                .to_owned(),
        );
    }
    for area in areas {
        tables.push(table(area));
    }
    Ok(document.to_string())
}

fn table(area: &FenceArea) -> Table {
    let config = area_config(area);
    let pair = |[a, b]: [f64; 2]| -> toml_edit::Value { Array::from_iter([a, b]).into() };
    let mut table = Table::new();
    table["name"] = value(format!("{PREFIX}{}", config.name));
    table["kind"] = value(match area.is_inclusion {
        true => "inclusion",
        false => "exclusion",
    });
    if let Some(vertices) = config.polygon {
        table["polygon"] = value(Array::from_iter(vertices.into_iter().map(pair)));
    }
    if let Some(centre) = config.centre {
        table["centre"] = value(pair(centre));
    }
    if let Some(radius_m) = config.radius_m {
        table["radius_m"] = value(radius_m);
    }
    table
}

#[cfg(test)]
mod tests {
    use plans::model::{FenceShape, Position};

    use super::*;

    fn circle(name: &str, is_inclusion: bool) -> FenceArea {
        FenceArea {
            name: name.to_owned(),
            is_inclusion,
            shape: FenceShape::Circle {
                centre: Position {
                    latitude_deg: 37.0,
                    longitude_deg: -6.0,
                },
                radius_m: 50.0,
            },
        }
    }

    fn names(text: &str) -> Vec<String> {
        let config: BridgeConfig = runtime::config::parse(text, "bridge.toml").unwrap();
        let fence = config.fence;
        let names = (0..fence.areas()).map(|index| fence.area_name(index).unwrap().to_owned());
        names.collect()
    }

    #[test]
    fn the_areas_of_the_last_plan_make_way_and_all_else_stays() {
        let text = "# ours\n[link]\npc_timeout_ms = 60000 # patient\n";
        let once = with_areas(text, &[circle("a", true), circle("b", false)]).unwrap();
        assert_eq!(names(&once), ["plan: a", "plan: b"]);
        let twice = with_areas(&once, &[circle("c", true)]).unwrap();
        assert_eq!(names(&twice), ["plan: c"]);
        assert!(twice.starts_with(text), "{twice}");
        let example = include_str!("../../../bridge/bridge.toml");
        let with_example = with_areas(example, &[circle("d", true)]).unwrap();
        assert_eq!(names(&with_example), ["plan: d"]);
        let lines_of = |text: &str| -> Vec<String> { text.lines().map(str::to_owned).collect() };
        let after = lines_of(&with_example);
        assert!(lines_of(example).iter().all(|line| after.contains(line)));
    }

    #[test]
    fn the_fence_never_becomes_wider() {
        let own = "[fence]\nceiling_m = 50.0\n[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [37.0, -6.0]\nradius_m = 9.0\n";
        let error = with_areas(own, &[circle("a", true)]).unwrap_err();
        assert!(error.contains("wider"), "{error}");
        let both = with_areas(own, &[circle("a", false)]).unwrap();
        assert_eq!(names(&both), ["field", "plan: a"]);
        assert!(both.contains("ceiling_m = 50.0"));
        assert!(with_areas("fence = 3", &[]).is_err());
        assert!(with_areas("[fence", &[]).is_err());
    }

    #[test]
    fn a_file_is_changed_and_taken_back_and_each_refusal_leaves_it_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bridge.toml");
        let put = |area: FenceArea| FenceChange::put(&path, &[area]);
        let read = put(circle("a", false));
        assert!(matches!(read, Err(FenceFileError::Read { .. })));
        let own = "[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [37.0, -6.0]\nradius_m = 90.0\n";
        fs::write(&path, own).unwrap();
        let wider = put(circle("a", true));
        assert!(matches!(wider, Err(FenceFileError::Refused { .. })));
        // No bridge takes an area that is as large as a country.
        let mut large = circle("a", false);
        if let FenceShape::Circle { radius_m, .. } = &mut large.shape {
            *radius_m = 1e9;
        }
        assert!(matches!(put(large), Err(FenceFileError::Configuration(_))));
        let text = || fs::read_to_string(&path).unwrap();
        assert_eq!(text(), own);
        let change = put(circle("a", false)).unwrap();
        assert!(change.areas == 2 && text().contains("plan: a"));
        change.take_back().unwrap();
        assert_eq!(text(), own);
        let change = put(circle("b", false)).unwrap();
        fs::write(&path, "# edited\n").unwrap();
        let changed = change.take_back();
        assert!(matches!(changed, Err(FenceFileError::Changed { .. })));
        assert_eq!(text(), "# edited\n");
    }

    #[test]
    fn a_file_that_this_user_may_not_replace_is_told_from_other_troubles() {
        let error = |kind: ErrorKind| FenceFileError::Write {
            path: "bridge.toml".into(),
            source: kind.into(),
        };
        assert!(error(ErrorKind::ReadOnlyFilesystem).is_forbidden());
        assert!(error(ErrorKind::PermissionDenied).is_forbidden());
        assert!(!error(ErrorKind::StorageFull).is_forbidden());
    }
}
