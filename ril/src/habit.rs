//! What an operator may still type from old habit: `ril status` started the process status in earlier versions.

use std::ffi::OsStr;
use std::path::Path;

use runtime::args::CommonArgs;
use runtime::config::load;
use runtime::exit::{ExitCode, Failure};

/// Refuses the configuration of the process status, given to `ril status`, which only asks.
///
/// # Errors
///
/// Exit code 78, so that a supervisor whose unit has the old command does not restart it; the failure names the new command.
pub fn refuse_the_configuration_of_a_process(common: &CommonArgs) -> Result<(), Failure> {
    let Some(file) = common.config.as_deref().filter(|file| is_of_status(file)) else {
        return Ok(());
    };
    let file = file.display();
    let text = format!(
        "{file} configures the process status, and `ril status` only shows a robot's state: start the process with \
         `ril run status --config {file}`"
    );
    Err(Failure::new(ExitCode::Configuration, text))
}

/// Whether a file configures the process status rather than the operator's commands: by its usual name, or because only
/// the process takes what is in it.
fn is_of_status(file: &Path) -> bool {
    file.file_name() == Some(OsStr::new(status::config::DEFAULT_FILE))
        || load::<crate::config::Config>(Some(file), file).is_err()
            && load::<status::config::Config>(Some(file), file).is_ok()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_of_the_process_is_told_from_one_of_the_operator() {
        let folder = std::env::temp_dir().join(format!("ril-habit-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        for (name, text, expected) in [
            ("status.toml", "", true),
            ("hero.toml", "[[log]]\ngroups = ['barometer']\n", true),
            ("ril.toml", "[observe]\ntimeout_s = 1\n", false),
            ("wrong.toml", "[serail]\n", false),
        ] {
            let file = folder.join(name);
            fs::write(&file, text).unwrap();
            assert_eq!(is_of_status(&file), expected, "{name}");
        }
        fs::remove_dir_all(&folder).unwrap();
    }
}
