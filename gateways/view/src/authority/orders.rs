//! [`OrderBook`]: orders by the numbers that pages chose, so that none is executed twice, and what became of them.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use ipc_types::MonotonicNs;

use crate::page::{OrderReport, OrderRequest, OrderStage};

/// A number is remembered for so long after the last report.
pub const MEMORY: Duration = Duration::from_secs(600);

/// Most numbers. At five a second it is fourteen minutes of one page; beyond, the oldest is forgotten.
pub const MAX_ORDERS: usize = 4096;

/// A page that comes is shown what ended so short a while ago: a reload must not hide how an order ended.
const SHOWN: Duration = Duration::from_secs(30);

/// Most that such a page is shown.
const MAX_SHOWN: usize = 20;

/// Most characters of a number.
const MAX_NUMBER: usize = 64;

/// Whether a text can be the number of an order.
pub(crate) fn is_number(text: &str) -> bool {
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-';
    (1..=MAX_NUMBER).contains(&text.len()) && text.bytes().all(is_part)
}

#[derive(Debug)]
struct KnownOrder {
    report: OrderReport,
    changed: MonotonicNs,
}

/// Orders by the numbers that pages chose, and what became of them.
#[derive(Debug, Default)]
pub(crate) struct OrderBook {
    known: BTreeMap<Arc<str>, KnownOrder>,
    /// All of `known`, the oldest first.
    ages: VecDeque<Arc<str>>,
}

impl OrderBook {
    /// What is known of this number.
    pub fn find(&self, number: &str) -> Option<&OrderReport> {
        self.known.get(number).map(|known| &known.report)
    }

    /// Remembers a new one, with how it began.
    pub fn begin(
        &mut self,
        order: &OrderRequest,
        stage: OrderStage,
        text: &str,
        now: MonotonicNs,
    ) -> &OrderReport {
        let number: Arc<str> = Arc::from(order.order.as_str());
        while self.ages.len() >= MAX_ORDERS {
            let oldest = self.ages.pop_front();
            oldest.and_then(|oldest| self.known.remove(&oldest));
        }
        self.ages.push_back(number.clone());
        let report = OrderReport {
            order: order.order.clone(),
            robot: order.robot,
            kind: order.kind,
            stage,
            text: text.to_owned(),
            is_final: stage == OrderStage::NotSent,
        };
        let known = self.known.entry(number).or_insert(KnownOrder {
            report,
            changed: now,
        });
        &known.report
    }

    /// Takes note of how far one has come. What was not ordered here is no news.
    pub fn report(&mut self, report: &OrderReport, now: MonotonicNs) {
        if let Some(known) = self.known.get_mut(report.order.as_str()) {
            known.report = report.clone();
            known.changed = now;
        }
    }

    /// What a page that comes to `robot` is shown, the oldest first.
    pub fn shown(&self, robot: u32, now: MonotonicNs) -> Vec<&OrderReport> {
        let of_robot = self.ages.iter().filter_map(|number| self.known.get(number));
        let mut shown: Vec<_> = of_robot
            .filter(|known| known.report.robot == robot)
            .filter(|known| !known.report.is_final || now.since(known.changed) <= SHOWN)
            .map(|known| &known.report)
            .collect();
        shown.split_off(shown.len().saturating_sub(MAX_SHOWN))
    }

    /// Forgets what is old.
    pub fn advance(&mut self, now: MonotonicNs) {
        while let Some(oldest) = self.ages.front() {
            // One whose end comes late keeps those behind it a little longer.
            if self
                .known
                .get(oldest)
                .is_some_and(|known| now.since(known.changed) < MEMORY)
            {
                break;
            }
            self.known.remove(oldest);
            self.ages.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::OrderKind;

    fn s(seconds: u64) -> MonotonicNs {
        MonotonicNs(seconds * 1_000_000_000)
    }

    fn order(number: &str, robot: u32) -> OrderRequest {
        OrderRequest {
            order: number.into(),
            robot,
            kind: OrderKind::Land,
            seen: 0,
            position: None,
            altitude_m: None,
            confirm: None,
        }
    }

    #[test]
    fn a_number_is_known_for_ten_minutes_after_its_last_report() {
        let mut book = OrderBook::default();
        let mut report = book
            .begin(&order("a", 1), OrderStage::Sent, "", s(0))
            .clone();
        assert!(!report.is_final);
        (report.stage, report.is_final) = (OrderStage::Done, true);
        book.report(&report, s(100));
        book.advance(MonotonicNs(s(700).0 - 1));
        assert_eq!(book.find("a"), Some(&report));
        book.advance(s(700));
        assert_eq!(book.find("a"), None);
        // A report of what is not known begins nothing.
        book.report(&report, s(700));
        assert_eq!(book.find("a"), None);
    }

    #[test]
    fn the_oldest_goes_at_the_bound() {
        let mut book = OrderBook::default();
        for index in 0..=MAX_ORDERS {
            book.begin(&order(&index.to_string(), 1), OrderStage::Sent, "", s(0));
        }
        assert_eq!(
            (book.find("0"), book.known.len(), book.ages.len()),
            (None, MAX_ORDERS, MAX_ORDERS)
        );
        assert!(book.find("1").is_some());
    }

    #[test]
    fn a_page_that_comes_finds_what_goes_on_and_what_ended_just_now() {
        let mut book = OrderBook::default();
        book.begin(&order("old", 1), OrderStage::NotSent, "", s(0));
        book.begin(&order("goes on", 1), OrderStage::Sent, "", s(0));
        book.begin(&order("other robot", 2), OrderStage::Sent, "", s(0));
        book.begin(&order("ended", 1), OrderStage::NotSent, "", s(10));
        let shown = |book: &OrderBook| -> Vec<String> {
            book.shown(1, s(40))
                .iter()
                .map(|one| one.order.clone())
                .collect()
        };
        assert_eq!(shown(&book), ["goes on", "ended"]);
        for index in 0..MAX_SHOWN {
            book.begin(&order(&index.to_string(), 1), OrderStage::Sent, "", s(40));
        }
        assert_eq!((shown(&book).len(), &*shown(&book)[0]), (MAX_SHOWN, "0"));
    }

    #[test]
    fn numbers_are_short_and_plain() {
        for (text, is) in [
            ("a1", true),
            ("0f-3", true),
            ("", false),
            ("a b", false),
            ("ü", false),
            ("\"", false),
        ] {
            assert_eq!(is_number(text), is, "{text}");
        }
        assert!(is_number(&"x".repeat(MAX_NUMBER)) && !is_number(&"x".repeat(MAX_NUMBER + 1)));
    }
}
