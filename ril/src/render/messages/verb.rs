//! [`Verb`]: the commands that send requests.

/// Which command a report answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verb {
    /// `ril start`
    Start,
    /// `ril stop`
    Stop,
    /// `ril fence reload`
    ReloadFence,
    /// `ril takeoff`
    TakeOff,
    /// `ril land`
    Land,
    /// `ril hold`
    Hold,
    /// `ril goto`
    GoTo,
    /// `ril param list`
    ListParameters,
    /// `ril param get`
    GetParameter,
    /// `ril param set`
    SetParameter,
}

impl Verb {
    /// All commands that send requests.
    pub const ALL: [Verb; 10] = [
        Verb::Start,
        Verb::Stop,
        Verb::ReloadFence,
        Verb::TakeOff,
        Verb::Land,
        Verb::Hold,
        Verb::GoTo,
        Verb::ListParameters,
        Verb::GetParameter,
        Verb::SetParameter,
    ];

    /// The command's name.
    pub const fn name(self) -> &'static str {
        match self {
            Verb::Start => "start",
            Verb::Stop => "stop",
            Verb::ReloadFence => "fence reload",
            Verb::TakeOff => "takeoff",
            Verb::Land => "land",
            Verb::Hold => "hold",
            Verb::GoTo => "goto",
            Verb::ListParameters => "param list",
            Verb::GetParameter => "param get",
            Verb::SetParameter => "param set",
        }
    }

    /// What happens to an accepted request when the command that sent it ends.
    pub const fn goes_on(self) -> &'static str {
        match self {
            Verb::Start | Verb::Stop | Verb::ReloadFence => {
                "the bridge goes on with it; `ril status` shows how it ends"
            }
            Verb::TakeOff => {
                "the take-off goes on and cannot be aborted; `ril status` shows how it ends"
            }
            Verb::Land => {
                "the landing goes on and cannot be aborted; `ril status` shows how it ends"
            }
            Verb::Hold => {
                "the bridge goes on stopping the helicopter; `ril status` shows how it ends"
            }
            Verb::GoTo => {
                "the path is flown to its end; `ril hold` makes the helicopter hover at once"
            }
            Verb::ListParameters | Verb::GetParameter => "nothing was changed",
            Verb::SetParameter => {
                "the bridge may still write the port; `ril param get` shows the value that the DSP has"
            }
        }
    }

    pub(super) const fn is_about_a_port(self) -> bool {
        matches!(
            self,
            Verb::ListParameters | Verb::GetParameter | Verb::SetParameter
        )
    }
}
