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
    let mut app = app(100);
    assert_eq!(app.robots.len(), MAX_ROBOTS);
    types(&mut app, "9\t");
    assert_eq!(app.selected, 9);
    types(&mut app, "1");
    app.key(Key::BackTab, NOW);
    assert_eq!(app.selected, MAX_ROBOTS - 1);
    types(&mut app, "\t");
    assert_eq!(app.selected, 0);
    let mut two = self::app(2);
    types(&mut two, "7");
    assert_eq!(two.selected, 0);
    assert_eq!(App::new(&[], Chart::default()).robots.len(), 1);
}

mod prompt {
    use super::super::*;

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
