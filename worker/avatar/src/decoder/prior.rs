//! Knowledge of people before a training.

use super::Decoder;
use std::sync::Arc;
use yoto_proto::v1::AppearancePrior;

/// The knowledge of people that a training starts with.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Prior {
    /// It knows nothing.
    None,
    /// The decoder that the program has.
    #[default]
    People,
    /// A decoder of one's own.
    Own(Arc<Decoder>),
}

impl Prior {
    /// The choice of an order.
    pub fn ordered(order: AppearancePrior) -> Self {
        match order {
            AppearancePrior::None => Self::None,
            AppearancePrior::Unspecified | AppearancePrior::People => Self::People,
        }
    }

    /// The name of its decoder for a model's state: whose it is, and its digest. `None` without a decoder.
    pub(crate) fn name(&self) -> Option<String> {
        let whose = match self {
            Self::None => return None,
            Self::People => "people",
            Self::Own(_) => "own",
        };
        self.decoder()
            .map(|decoder| format!("{whose} {}", decoder.digest()))
    }

    /// Its decoder.
    pub(crate) fn decoder(&self) -> Option<&Decoder> {
        match self {
            Self::None => None,
            Self::People => Some(Decoder::people()),
            Self::Own(decoder) => Some(decoder),
        }
    }
}
