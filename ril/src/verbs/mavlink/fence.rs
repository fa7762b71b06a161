//! [`FenceFile`]: puts a station's fence into the bridge's configuration file, by the code of `ril plan fly --fence`.

use std::fs;
use std::path::{Path, PathBuf};

use bridge::BridgeConfig;
use mavlink_gateway::FenceRefusal;
use mavlink_gateway::number::MissionResult;
use plans::model::FenceArea;
use runtime::durable;

use crate::fence_file::with_areas;

/// See the module's documentation.
#[derive(Debug, Default)]
pub(super) struct FenceFile {
    /// What was changed last, and its text of before.
    before: Option<(PathBuf, String)>,
}

impl FenceFile {
    /// Nothing was changed yet.
    pub fn new() -> FenceFile {
        FenceFile::default()
    }

    /// Puts the areas into `file` in place of those of the last fence; how many areas it has then. It waits for the disk, milliseconds as a
    /// rule.
    ///
    /// # Errors
    ///
    /// Why it was not changed.
    pub fn put(&mut self, file: &Path, areas: &[FenceArea]) -> Result<usize, FenceRefusal> {
        let name = file.display();
        let refusal = |result, text| FenceRefusal { result, text };
        let before = fs::read_to_string(file).map_err(|error| {
            refusal(
                MissionResult::Error,
                format!("{name} cannot be read: {error}"),
            )
        })?;
        let after = with_areas(&before, areas)
            .map_err(|why| refusal(MissionResult::Denied, format!("{name}: {why}")))?;
        let config: BridgeConfig = runtime::config::parse(&after, name.to_string())
            .map_err(|error| refusal(MissionResult::Invalid, error.to_string()))?;
        durable::replace(file, after.as_bytes()).map_err(|error| {
            refusal(
                MissionResult::Error,
                format!("{name} cannot be written: {error}"),
            )
        })?;
        self.before = Some((file.to_owned(), before));
        Ok(config.fence.areas())
    }

    /// Makes the file what it was before the last change.
    ///
    /// # Errors
    ///
    /// Why it was not written, as a clause.
    pub fn restore(&mut self) -> Result<(), String> {
        match self.before.take() {
            Some((file, text)) => durable::replace(&file, text.as_bytes())
                .map_err(|error| format!("{}: {error}", file.display())),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use plans::model::{FenceShape, Position};

    use super::*;

    fn circle(is_inclusion: bool, radius_m: f64) -> FenceArea {
        let centre = Position {
            latitude_deg: 37.0,
            longitude_deg: -6.0,
        };
        FenceArea {
            name: "a".to_owned(),
            is_inclusion,
            shape: FenceShape::Circle { centre, radius_m },
        }
    }

    #[test]
    fn a_file_is_changed_and_restored_and_each_refusal_leaves_it_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bridge.toml");
        let mut file = FenceFile::new();
        let result = |put: Result<usize, FenceRefusal>| put.unwrap_err().result;
        let area = circle(false, 9.0);
        let unread = file.put(&path, std::slice::from_ref(&area));
        assert_eq!(result(unread), MissionResult::Error);
        let own = "[[fence.area]]\nname = \"field\"\nkind = \"inclusion\"\ncentre = [37.0, -6.0]\nradius_m = 90.0\n";
        fs::write(&path, own).unwrap();
        assert_eq!(
            result(file.put(&path, &[circle(true, 9.0)])),
            MissionResult::Denied
        );
        // No bridge takes an area that is as large as a country.
        assert_eq!(
            result(file.put(&path, &[circle(false, 1e9)])),
            MissionResult::Invalid
        );
        let text = || fs::read_to_string(&path).unwrap();
        assert_eq!((file.restore(), text().as_str()), (Ok(()), own));
        assert_eq!(file.put(&path, &[area]), Ok(2));
        assert!(text().contains("plan: a"));
        assert_eq!(file.put(&path, &[]), Ok(1));
        assert!(!text().contains("plan: a"));
        assert_eq!(file.restore(), Ok(()));
        assert!(text().contains("plan: a"));
    }
}
