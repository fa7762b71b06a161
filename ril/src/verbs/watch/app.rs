//! [`App`]: all robots that are watched, which of them is selected, and what a key does.
//!
//! [`Prompt`]: an order is confirmed by its whole word and Enter, within some seconds. A key that is hit by accident, a
//! text that is pasted and a cat on the keyboard send nothing.

#[cfg(test)]
mod tests;

use std::time::Duration;

use ipc_types::{MonotonicNs, RobotId};
use operator::render::terminal::Key;
use operator::request::ports::RobotOrder;
use operator::robot::changes::Weight;
use operator::robot::chart::Chart;
use operator::robot::chart::ChartArea;
use operator::robot::geo::Place;
use operator::robot::model::WatchedRobot;

/// Most robots that are watched at a time: as many as a station's relay carries. The first nine have a key of their
/// own.
pub const MAX_ROBOTS: usize = 64;

/// What the shell is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyAction {
    /// Nothing.
    None,
    /// End.
    Quit,
    /// Draw all of the screen.
    Redraw,
    /// Give the terminal to the shell.
    Suspend,
    /// Send this order to the robot of this index.
    Send(usize, ScreenOrder),
}

/// What the map shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Zoom {
    /// All of the flight: robot, take-off, track and path.
    #[default]
    Flight,
    /// The surroundings of the robot.
    Near,
    /// All of the fence, too.
    Fence,
}

impl Zoom {
    fn next(self) -> Zoom {
        match self {
            Zoom::Flight => Zoom::Near,
            Zoom::Near => Zoom::Fence,
            Zoom::Fence => Zoom::Flight,
        }
    }

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Zoom::Flight => "flight",
            Zoom::Near => "near",
            Zoom::Fence => "fence",
        }
    }
}

/// All robots that are watched, which of them is selected, and what a key does.
#[derive(Clone, Debug)]
pub struct App {
    /// In the order of their keys.
    pub(super) robots: Vec<WatchedRobot>,
    /// The index of the robot in detail.
    pub(super) selected: usize,
    /// The question that waits for its word.
    pub(super) prompt: Option<Prompt>,
    /// What the map shows.
    pub(super) zoom: Zoom,
    /// The path of a plan, and the fence of a file, for robots whose bridge does not say what it holds.
    pub(super) chart: Chart,
}

impl App {
    /// Watches `robots`, of which those beyond [`MAX_ROBOTS`] are left out; without one it is robot 1.
    pub fn new(robots: &[RobotId], chart: Chart) -> App {
        let mut robots: Vec<WatchedRobot> = robots
            .iter()
            .take(MAX_ROBOTS)
            .map(|robot| WatchedRobot::new(*robot))
            .collect();
        if robots.is_empty() {
            robots.push(WatchedRobot::new(RobotId::DEFAULT));
        }
        App {
            robots,
            selected: 0,
            prompt: None,
            zoom: Zoom::default(),
            chart,
        }
    }

    /// Takes a key.
    pub fn key(&mut self, key: Key, now: MonotonicNs) -> KeyAction {
        if key == Key::Suspend {
            return KeyAction::Suspend;
        }
        if let Some(mut prompt) = self.prompt.take() {
            return match prompt.key(key, now) {
                PromptAnswer::Open => {
                    self.prompt = Some(prompt);
                    KeyAction::None
                }
                PromptAnswer::Confirmed => KeyAction::Send(self.selected, prompt.order),
                PromptAnswer::Cancelled(why) => {
                    self.cancelled(&prompt, why, now);
                    KeyAction::None
                }
            };
        }
        match key {
            Key::Char('q') | Key::Interrupt => return KeyAction::Quit,
            Key::Redraw => return KeyAction::Redraw,
            Key::Char('h') => self.ask(ScreenOrder::Hold, now),
            Key::Char('l') => self.ask(ScreenOrder::Land, now),
            Key::Char('s') => self.ask(ScreenOrder::Stop, now),
            Key::Char('z') => self.zoom = self.zoom.next(),
            Key::Tab => self.selected = (self.selected + 1) % self.robots.len(),
            Key::BackTab => {
                self.selected = (self.selected + self.robots.len() - 1) % self.robots.len();
            }
            Key::Char(digit @ '1'..='9') => {
                let index = usize::from(digit as u8 - b'1');
                if index < self.robots.len() {
                    self.selected = index;
                }
            }
            _ => {}
        }
        KeyAction::None
    }

    /// Judges all robots at `now`, and ends a prompt that took too long.
    pub fn judge(&mut self, now: MonotonicNs) {
        for robot in &mut self.robots {
            robot.judge(now);
        }
        if let Some(prompt) = self.prompt.take_if(|prompt| prompt.is_over(now)) {
            self.cancelled(&prompt, "not confirmed in time", now);
        }
    }

    /// When the screen changes although nothing comes.
    pub fn next(&self, now: MonotonicNs) -> Option<MonotonicNs> {
        let robots = self.robots.iter().filter_map(|robot| robot.next(now));
        robots
            .chain(self.prompt.as_ref().map(|prompt| prompt.ends))
            .min()
    }

    /// How often the bell is to ring.
    pub fn take_bells(&mut self) -> u32 {
        self.robots.iter_mut().map(WatchedRobot::take_bells).sum()
    }

    fn ask(&mut self, order: ScreenOrder, now: MonotonicNs) {
        let robot = self.robots[self.selected].id;
        self.prompt = Some(Prompt::new(order, robot, now));
    }

    fn cancelled(&mut self, prompt: &Prompt, why: &str, now: MonotonicNs) {
        let text = format!("{}: {why}, nothing was sent", prompt.order.word());
        self.robots[self.selected]
            .journal
            .add(now, Weight::Order, text);
    }

    /// The robots, to be fed, in the order of their keys.
    pub fn robots_mut(&mut self) -> &mut [WatchedRobot] {
        &mut self.robots
    }

    /// The fence of the robot in detail.
    pub(super) fn fence(&self) -> &[ChartArea] {
        let held = self.robot().held.as_ref();
        held.map_or(&self.chart.fence, |held| &held.chart.fence)
    }

    /// The path that the robot in detail flies; without one that of the plan.
    pub(super) fn path(&self) -> &[Place] {
        let held = self.robot().held.as_ref().map(|held| &held.chart.path);
        let flown = held.filter(|path| !path.is_empty());
        flown.unwrap_or(&self.chart.path)
    }

    /// The robot in detail.
    pub(super) fn robot(&self) -> &WatchedRobot {
        &self.robots[self.selected]
    }
}

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

/// An order that waits for its confirmation: its whole word and Enter, within some seconds.
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
