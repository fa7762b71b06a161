//! [`SetUp`]: the start of every process: logging, configuration, signals, domain.

use std::fmt::Debug;
use std::path::{Path, PathBuf};

use ipc_types::{Domain, Ipc, RobotId};
use runtime::args::CommonArgs;
use runtime::config::Fault;
use runtime::exit::{ExitCode, Failure, OrFail};
use runtime::notify::Notifier;
use runtime::signal::Termination;
use runtime::{config, logging};
use serde::de::DeserializeOwned;

/// What a process has before it opens its ports.
#[derive(Debug)]
pub struct SetUp<C> {
    /// The configuration.
    pub config: C,
    /// The file that it was read from; `None` if there was none.
    pub file: Option<PathBuf>,
    /// SIGINT and SIGTERM.
    pub termination: Termination,
    /// The supervisor, which is notified that the process is ready and works.
    pub supervisor: Notifier,
    /// Which shared memory.
    pub domain: Domain,
    /// Which robot.
    pub robot: RobotId,
}

impl<C: DeserializeOwned + Default + Debug> SetUp<C> {
    /// Begins logging, reads the configuration from the file that `args` name or else from `default_file`, which may be
    /// absent, and takes the signals. Nothing comes back when only the configuration was to be checked.
    ///
    /// # Errors
    /// Exit code 78 when the configuration or the environment is wrong, 1 when the signals have another owner.
    pub fn begin(args: &CommonArgs, default_file: &str) -> Result<Option<SetUp<C>>, Failure> {
        SetUp::begin_with(args, default_file, |_| Ok(()))
    }

    /// The same for a process whose command line replaces values of the configuration, or whose values must fit together: `check`
    /// does the one and looks at the other. What it refuses has file and line, at a start as well as when only the configuration
    /// is to be checked.
    ///
    /// # Errors
    /// As above.
    pub fn begin_with(
        args: &CommonArgs,
        default_file: &str,
        check: impl FnOnce(&mut C) -> Result<(), Fault>,
    ) -> Result<Option<SetUp<C>>, Failure> {
        logging::init(args.verbosity())?;
        let mut loaded = config::load::<C>(args.config.as_deref(), Path::new(default_file))?;
        let file = match &loaded.file {
            Some(file) => file.display().to_string(),
            None => "built-in defaults".to_owned(),
        };
        check(&mut loaded.value).map_err(|fault| loaded.refuse(&fault))?;
        tracing::debug!(%file, config = ?loaded.value, "configuration");
        if args.check_config {
            tracing::info!(%file, "the configuration is right");
            return Ok(None);
        }
        // Before anything that must be left in order.
        let termination = Termination::install().or_fail(ExitCode::Internal)?;
        Ok(Some(SetUp {
            config: loaded.value,
            file: loaded.file,
            termination,
            supervisor: Notifier::from_env(),
            domain: Domain::from_environment().or_fail(ExitCode::Configuration)?,
            robot: RobotId::from(args.robot),
        }))
    }

    /// Joins the robot's shared memory as the process `name`.
    ///
    /// # Errors
    /// Exit code 1 when it cannot be used.
    pub fn join(&self, name: &str) -> Result<Ipc, Failure> {
        let what = || format!("{name} cannot join the shared memory");
        Ipc::join(&self.domain, self.robot, name).or_fail_with(ExitCode::Internal, what())
    }
}
