//! What a person agrees to, in words for files that leave the service.

use prost_types::Timestamp;
use std::fmt::Write;
use yoto_proto::v1::consent_item::State;
use yoto_proto::v1::{Consent, ConsentPurpose};

/// The purposes as words, in their order.
const PURPOSES: [(ConsentPurpose, &str); 4] = [
    (ConsentPurpose::ConsentTrain, "train"),
    (ConsentPurpose::ConsentRender, "render"),
    (ConsentPurpose::ConsentExport, "export"),
    (ConsentPurpose::ConsentShare, "share"),
];

/// The line of a person's `records` at `now`: to which purposes there is a valid record, until when, and which
/// recorded purposes have none any more. Neither notes nor names are in it.
pub fn line<'a>(records: impl Iterator<Item = &'a Consent> + Clone, now: Timestamp) -> String {
    let (mut given, mut ended) = (Vec::new(), Vec::new());
    for (purpose, word) in PURPOSES {
        let of_purpose = records.clone().filter_map(|consent| {
            let item = consent.items.iter().find(|it| it.purpose() == purpose)?;
            Some((item.state(), consent.expire_time))
        });
        if of_purpose.clone().next().is_none() {
            continue;
        }
        let valid = of_purpose.filter(|(state, _)| *state == State::Valid);
        let ends: Vec<_> = valid.map(|(_, end)| end).collect();
        let last = ends
            .iter()
            .flatten()
            .max_by_key(|it| (it.seconds, it.nanos));
        match last {
            _ if ends.is_empty() => ended.push(word.to_owned()),
            Some(end) if ends.iter().all(Option::is_some) => {
                given.push(format!("{word} until {end}"))
            }
            _ => given.push(word.to_owned()),
        }
    }
    if given.is_empty() && ended.is_empty() {
        return String::new();
    }
    let mut line = format!("As of {now}, the person shown");
    // Writing to a String can't fail.
    if !given.is_empty() {
        let _ = write!(line, " agrees to: {}", given.join(", "));
    }
    if !ended.is_empty() {
        let but = if given.is_empty() { "" } else { ";" };
        let _ = write!(line, "{but} does not agree to: {}", ended.join(", "));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::ConsentItem;

    fn record(purposes: &[(ConsentPurpose, State)], end: Option<i64>) -> Consent {
        let item = |(purpose, state): &(ConsentPurpose, State)| ConsentItem {
            purpose: (*purpose).into(),
            state: (*state).into(),
            revoke_time: None,
        };
        Consent {
            items: purposes.iter().map(item).collect(),
            given_by: "Ada's father".into(),
            note: "form 17".into(),
            expire_time: end.map(|seconds| Timestamp { seconds, nanos: 0 }),
            ..Consent::default()
        }
    }

    #[test]
    fn the_line_has_the_longest_consent_of_each_purpose_and_no_names() {
        use ConsentPurpose::{
            ConsentExport as Export, ConsentShare as Share, ConsentTrain as Train,
        };
        let at = |seconds| Timestamp { seconds, nanos: 0 };
        assert_eq!(line([].iter(), at(0)), "");
        let records = [
            record(
                &[(Train, State::Valid), (Share, State::Revoked)],
                Some(86_400),
            ),
            record(
                &[(Train, State::Valid), (Export, State::Valid)],
                Some(172_800),
            ),
            record(&[(Export, State::Valid)], None),
        ];
        assert_eq!(
            line(records.iter(), at(0)),
            "As of 1970-01-01T00:00:00Z, the person shown agrees to: train until 1970-01-03T00:00:00Z, export; \
             does not agree to: share"
        );
        let refused = [record(&[(Share, State::Expired)], Some(1))];
        assert_eq!(
            line(refused.iter(), at(2)),
            "As of 1970-01-01T00:00:02Z, the person shown does not agree to: share"
        );
    }
}
