//! [`Prompt`]: an order is confirmed by its whole word and Enter, within some seconds. A key that is hit by accident, a text that is
//! pasted and a cat on the keyboard send nothing.

use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};

use crate::render::terminal::Key;
use crate::request::order::RobotOrder;

/// How long the word may take.
pub const TIMEOUT: Duration = Duration::from_secs(10);

/// Most characters that are taken of what is typed: more than the longest word, so that a wrong one is seen.
const MAX_TYPED: usize = 12;

/// What can be ordered from the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScreenOrder {
    /// `ril hold`
    Hold,
    /// `ril land --preempt`
    Land,
    /// `ril stop`
    Stop,
}

impl ScreenOrder {
    /// The word that confirms it, which is also the command's.
    pub fn word(self) -> &'static str {
        match self {
            ScreenOrder::Hold => "hold",
            ScreenOrder::Land => "land",
            ScreenOrder::Stop => "stop",
        }
    }

    /// What it does.
    pub fn effect(self) -> &'static str {
        match self {
            ScreenOrder::Hold => "hover on the spot; replaces a path",
            ScreenOrder::Land => "land on the spot; replaces a path",
            ScreenOrder::Stop => {
                "hover, discard all that was planned, take no movement until a start"
            }
        }
    }
}

impl From<ScreenOrder> for RobotOrder {
    fn from(order: ScreenOrder) -> RobotOrder {
        match order {
            ScreenOrder::Hold => RobotOrder::Hold,
            ScreenOrder::Land => RobotOrder::Land,
            ScreenOrder::Stop => RobotOrder::Stop,
        }
    }
}

/// What became of a prompt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PromptAnswer {
    /// It is not answered yet.
    Open,
    /// The order is to be sent.
    Confirmed,
    /// Nothing is sent, for this reason.
    Cancelled(&'static str),
}

/// See the module's documentation.
#[derive(Clone, Debug, PartialEq)]
pub struct Prompt {
    /// What is asked for.
    pub(super) order: ScreenOrder,
    /// Which robot the order is for.
    pub(super) robot: RobotId,
    /// What was typed so far.
    pub(super) typed: String,
    /// When it is over.
    pub(super) ends: MonotonicNs,
}

impl Prompt {
    /// Asks for the word of `order` for `robot`.
    pub fn new(order: ScreenOrder, robot: RobotId, now: MonotonicNs) -> Prompt {
        Prompt {
            order,
            robot,
            typed: String::new(),
            ends: now + TIMEOUT,
        }
    }

    /// Takes a key.
    pub fn key(&mut self, key: Key, now: MonotonicNs) -> PromptAnswer {
        if now >= self.ends {
            return PromptAnswer::Cancelled("not confirmed in time");
        }
        match key {
            Key::Enter if self.typed == self.order.word() => return PromptAnswer::Confirmed,
            Key::Enter => return PromptAnswer::Cancelled("another word was typed"),
            Key::Escape | Key::Interrupt => return PromptAnswer::Cancelled("not confirmed"),
            Key::Backspace => _ = self.typed.pop(),
            Key::Char(letter) if self.typed.len() < MAX_TYPED && letter.is_ascii_graphic() => {
                self.typed.push(letter.to_ascii_lowercase());
            }
            _ => {}
        }
        PromptAnswer::Open
    }

    /// Whether it is over at `now` because nothing was confirmed in time.
    pub fn is_over(&self, now: MonotonicNs) -> bool {
        now >= self.ends
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: MonotonicNs = MonotonicNs(5_000_000_000);

    fn answer(order: ScreenOrder, text: &str) -> PromptAnswer {
        let mut prompt = Prompt::new(order, RobotId::DEFAULT, NOW);
        let mut answer = PromptAnswer::Open;
        for letter in text.chars() {
            let key = match letter {
                '\n' => Key::Enter,
                '\x1b' => Key::Escape,
                '\x7f' => Key::Backspace,
                letter => Key::Char(letter),
            };
            answer = prompt.key(key, NOW);
            if answer != PromptAnswer::Open {
                break;
            }
        }
        answer
    }

    #[test]
    fn only_the_whole_word_and_enter_confirm() {
        for (order, text, confirms) in [
            (ScreenOrder::Hold, "hold\n", true),
            (ScreenOrder::Land, "LAND\n", true),
            (ScreenOrder::Stop, "stopp\x7f\n", true),
            (ScreenOrder::Hold, "hold", false),
            (ScreenOrder::Hold, "h\n", false),
            (ScreenOrder::Hold, "\n", false),
            (ScreenOrder::Hold, "old\n", false),
            (ScreenOrder::Hold, "hhhhhhhhhhhhhhhhhhhh\n", false),
            (ScreenOrder::Land, "hold\n", false),
            (ScreenOrder::Land, "hold\x1bland\n", false),
            (ScreenOrder::Land, "land land\n", false),
        ] {
            assert_eq!(
                answer(order, text) == PromptAnswer::Confirmed,
                confirms,
                "{text:?}"
            );
        }
    }

    #[test]
    fn it_is_over_after_its_time() {
        let mut prompt = Prompt::new(ScreenOrder::Land, RobotId::DEFAULT, NOW);
        for letter in "land".chars() {
            prompt.key(Key::Char(letter), NOW);
        }
        let late = NOW + TIMEOUT;
        assert!(!prompt.is_over(NOW) && prompt.is_over(late));
        assert!(matches!(
            prompt.key(Key::Enter, late),
            PromptAnswer::Cancelled(_)
        ));
    }
}
