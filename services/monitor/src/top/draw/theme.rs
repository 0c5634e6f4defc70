//! Colours of the Okabe-Ito palette, told apart by all eyes, as the nearest of the terminal's 256. No colour stands alone:
//! what it says is also said by a word or a sign.

use ratatui::style::{Color, Modifier, Style};

const SKY: Color = Color::Indexed(74);
const ORANGE: Color = Color::Indexed(214);
const VERMILLION: Color = Color::Indexed(202);
const GREEN: Color = Color::Indexed(36);
const PURPLE: Color = Color::Indexed(175);
const GREY: Color = Color::Indexed(245);

/// The rule above a panel.
pub(super) fn rule(chosen: bool) -> Style {
    if chosen { Style::new().fg(SKY) } else { faint() }
}

/// A panel's name.
pub(super) fn title(chosen: bool) -> Style {
    if chosen { Style::new().fg(SKY).add_modifier(Modifier::BOLD) } else { Style::new().add_modifier(Modifier::BOLD) }
}

/// What is there to be found, not to be seen first.
pub(super) fn faint() -> Style {
    Style::new().fg(GREY)
}

pub(super) fn strong() -> Style {
    Style::new().add_modifier(Modifier::BOLD)
}

/// Something to look at.
pub(super) fn warning() -> Style {
    Style::new().fg(ORANGE)
}

/// Something was lost.
pub(super) fn alarm() -> Style {
    Style::new().fg(VERMILLION).add_modifier(Modifier::BOLD)
}

/// A sweep in time.
pub(super) fn bar() -> Style {
    Style::new().fg(SKY)
}

/// Over everything else.
pub(super) fn notice() -> Style {
    Style::new().fg(ORANGE).add_modifier(Modifier::REVERSED)
}

/// Of a class, by its name.
pub(super) fn class(name: &str) -> Style {
    match name {
        "rectangular" => Style::new().fg(SKY),
        "ellipsoidal" => Style::new().fg(ORANGE),
        "cylindrical" => Style::new().fg(GREEN),
        "conical" => Style::new().fg(PURPLE),
        _ => faint(),
    }
}
