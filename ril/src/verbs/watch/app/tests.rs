//! What keys do.

use super::*;
use crate::verbs::watch::app::TIMEOUT;

const NOW: MonotonicNs = MonotonicNs(7_000_000_000);

fn app(robots: u32) -> App {
    let robots: Vec<RobotId> = (1..=robots).map(|id| RobotId::new(id).unwrap()).collect();
    App::new(&robots, Chart::default())
}

fn types(app: &mut App, text: &str) -> Vec<KeyAction> {
    let key = |letter| match letter {
        '\n' => Key::Enter,
        '\t' => Key::Tab,
        letter => Key::Char(letter),
    };
    text.chars()
        .map(|letter| app.key(key(letter), NOW))
        .collect()
}

#[test]
fn an_order_goes_to_the_selected_robot_after_its_whole_word() {
    let mut app = app(3);
    types(&mut app, "2l");
    assert_eq!(app.prompt.as_ref().unwrap().robot.get(), 2);
    let actions = types(&mut app, "land\n");
    let (last, before) = actions.split_last().unwrap();
    assert_eq!(*last, KeyAction::Send(1, ScreenOrder::Land));
    assert!(before.iter().all(|action| *action == KeyAction::None));
    assert!(app.prompt.is_none());
}

#[test]
fn while_a_word_is_typed_the_robot_cannot_change_and_q_does_not_end() {
    let mut app = app(3);
    let actions = types(&mut app, "h\t2q\n");
    assert!(actions.iter().all(|action| *action == KeyAction::None));
    assert_eq!(app.selected, 0);
    let line = app.robot().journal.newest(1).next().unwrap();
    assert_eq!(line.text, "hold: another word was typed, nothing was sent");
}

#[test]
fn a_word_that_is_pasted_sends_nothing() {
    for word in ["hold\n", "land\n", "stop\n"] {
        let mut app = app(1);
        for action in types(&mut app, word) {
            assert_eq!(action, KeyAction::None);
        }
    }
}

#[test]
fn a_prompt_that_takes_too_long_ends_by_itself() {
    let mut app = app(1);
    types(&mut app, "shol");
    app.judge(NOW + TIMEOUT);
    assert!(app.prompt.is_none());
    assert_eq!(types(&mut app, "q"), [KeyAction::Quit]);
}

#[test]
fn keys_select_robots_and_those_that_are_not_there_are_nothing() {
    let mut app = app(20);
    assert_eq!(app.robots.len(), MAX_ROBOTS);
    types(&mut app, "9");
    assert_eq!(app.selected, 8);
    types(&mut app, "\t");
    assert_eq!(app.selected, 0);
    app.key(Key::BackTab, NOW);
    assert_eq!(app.selected, 8);
    let mut two = self::app(2);
    types(&mut two, "7");
    assert_eq!(two.selected, 0);
    assert_eq!(App::new(&[], Chart::default()).robots.len(), 1);
}
