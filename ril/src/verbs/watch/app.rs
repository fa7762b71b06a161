//! [`App`]: all robots that are watched, which of them is selected, and what a key does.

#[cfg(test)]
mod tests;

use ipc_types::{MonotonicNs, RobotId};

use super::prompt::{Prompt, PromptAnswer, ScreenOrder};
use crate::render::terminal::Key;
use crate::robot::changes::Weight;
use crate::robot::chart::{AreaOutline, Chart};
use crate::robot::geo::Place;
use crate::robot::model::WatchedRobot;

/// Most robots that are watched at a time: those with a key of their own.
pub const MAX_ROBOTS: usize = 9;

/// What the shell is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyAction {
    /// Nothing.
    None,
    /// End.
    Quit,
    /// Draw all of the screen.
    Redraw,
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

/// See the module's documentation.
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
    pub(super) fn fence(&self) -> &[AreaOutline] {
        let held = self.robot().held.as_ref();
        held.map_or(&self.chart.fence, |(_, chart)| &chart.fence)
    }

    /// The path that the robot in detail flies; without one that of the plan.
    pub(super) fn path(&self) -> &[Place] {
        let held = self.robot().held.as_ref().map(|(_, chart)| &chart.path);
        let flown = held.filter(|path| !path.is_empty());
        flown.unwrap_or(&self.chart.path)
    }

    /// The robot in detail.
    pub(super) fn robot(&self) -> &WatchedRobot {
        &self.robots[self.selected]
    }
}
