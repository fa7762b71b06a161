//! DSP errors: how many of which, and which of them end the functionality (requirements D9, H4, `TranslateErrorCode`).

use dsp_protocol::DspErrorCode;
use ipc_types::code::{ImiError, Reason};
use ipc_types::payload::{DspErrorCounters, KNOWN_DSP_ERRORS};

/// Each code that is known has a counter.
const _: () = assert!(DspErrorCode::KNOWN.len() == KNOWN_DSP_ERRORS);

/// Which DSP errors are fatal. The rest are counted and shown.
#[derive(Clone, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ErrorTable {
    /// Codes that mean hero-DSP-fatal-error.
    pub hero_dsp_fatal: Vec<u16>,
    /// Codes that mean communication-fatal-error.
    pub communication_fatal: Vec<u16>,
}

impl Default for ErrorTable {
    /// The source's mapping but for 102, a checksum error from the PC: a repetition cures it, so it costs a repetition
    /// and not the flight.
    fn default() -> Self {
        ErrorTable {
            hero_dsp_fatal: vec![8, 18],
            communication_fatal: vec![],
        }
    }
}

impl ErrorTable {
    /// What `code` becomes above the bridge; `None` if it is not fatal.
    pub fn escalates(&self, code: DspErrorCode) -> Option<ImiError> {
        if self.hero_dsp_fatal.contains(&code.0) {
            Some(ImiError::HeroDspFatalError)
        } else if self.communication_fatal.contains(&code.0) {
            Some(ImiError::CommunicationFatalError)
        } else {
            None
        }
    }
}

/// The reason that a report gives for an IMI error.
pub fn reason_of(error: ImiError) -> Reason {
    match error {
        ImiError::None => Reason::None,
        ImiError::ModuleRunningToRestartStopItBefore => Reason::AlreadyRunning,
        ImiError::ImpossibleToStopModule => Reason::UnableToAbort,
        ImiError::HeroDspFatalError => Reason::DspFatalError,
        ImiError::CommunicationFatalError => Reason::CommunicationFatalError,
        ImiError::MovementTimeout => Reason::MovementTimeout,
    }
}

/// Counts `code`. Counters stop at their greatest value.
pub fn count(counters: &mut DspErrorCounters, code: DspErrorCode) {
    counters.total = counters.total.saturating_add(1);
    counters.last_code = u32::from(code.0);
    let counter = match code.counter_index() {
        Some(index) => &mut counters.known[index],
        None => &mut counters.unknown,
    };
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sources_mapping_stays_available() {
        assert!(ErrorTable::default().communication_fatal.is_empty());
        let table = ErrorTable {
            communication_fatal: vec![102],
            ..ErrorTable::default()
        };
        for code in DspErrorCode::KNOWN {
            let expected = match code.0 {
                8 | 18 => Some(ImiError::HeroDspFatalError),
                102 => Some(ImiError::CommunicationFatalError),
                _ => None,
            };
            assert_eq!(table.escalates(code), expected, "{code:?}");
        }
        assert_eq!(table.escalates(DspErrorCode(999)), None);
    }

    #[test]
    fn each_code_has_its_counter_and_unknown_ones_share_one() {
        let mut counters = DspErrorCounters::default();
        for code in DspErrorCode::KNOWN {
            count(&mut counters, code);
        }
        count(&mut counters, DspErrorCode(77));
        assert_eq!(counters.known, [1; 26]);
        assert_eq!(
            (counters.total, counters.unknown, counters.last_code),
            (27, 1, 77)
        );
    }
}
