//! Colours, fonts and sizes of the controls, for a light and a dark theme.

use std::sync::Arc;

use egui::style::{HandleShape, ScrollStyle, Selection, WidgetVisuals};
use egui::{
    Color32, Context, CornerRadius, FontData, FontDefinitions, FontFamily, FontId, Margin, Shadow, Stroke, StrokeKind,
    Style, TextStyle, Theme, Vec2, Visuals,
};

/// Width of the panel, in points.
pub const WIDTH: f32 = 300.0;
/// Distance of panel and cards from the window's border, in points.
pub const GAP: f32 = 10.0;
/// Inner margin of panel and cards, in points.
pub const PAD: f32 = 14.0;
/// Height of a clickable control, in points.
pub const ROW: f32 = 26.0;

/// Colours of a theme. Text on `card` or `field` has a contrast of at least 4.5:1 over any picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colors {
    /// Background of panel and cards, slightly translucent.
    pub card: Color32,
    /// Background of a control.
    pub field: Color32,
    /// Background of a hovered control.
    pub hover: Color32,
    pub text: Color32,
    /// Less important text.
    pub weak: Color32,
    /// Selected controls and significant lines.
    pub accent: Color32,
    /// Text on `accent`.
    pub on_accent: Color32,
    pub line: Color32,
    /// Errors, and recording.
    pub alarm: Color32,
}

const DARK: Colors = Colors {
    card: Color32::from_rgba_unmultiplied_const(22, 23, 27, 234),
    field: Color32::from_rgb(52, 54, 61),
    hover: Color32::from_rgb(68, 71, 79),
    text: Color32::from_rgb(240, 240, 242),
    weak: Color32::from_rgb(182, 185, 192),
    accent: Color32::from_rgb(255, 190, 92),
    on_accent: Color32::from_rgb(38, 24, 4),
    line: Color32::from_rgb(74, 77, 86),
    alarm: Color32::from_rgb(255, 122, 110),
};

const LIGHT: Colors = Colors {
    card: Color32::from_rgba_unmultiplied_const(250, 250, 251, 242),
    field: Color32::from_rgb(228, 229, 233),
    hover: Color32::from_rgb(213, 215, 221),
    text: Color32::from_rgb(26, 27, 31),
    weak: Color32::from_rgb(80, 84, 92),
    accent: Color32::from_rgb(152, 76, 0),
    on_accent: Color32::from_rgb(255, 255, 255),
    line: Color32::from_rgb(196, 199, 206),
    alarm: Color32::from_rgb(178, 24, 24),
};

/// Marks on the picture, in both themes: light lines with a dark border stand out on any picture.
pub const OVERLAY_COLOR: Color32 = Color32::from_rgb(255, 255, 255);
pub const OVERLAY_OUTLINE: Color32 = Color32::from_rgba_premultiplied(0, 0, 0, 150);

impl Colors {
    /// Returns the colours of a theme.
    pub fn for_theme(theme: Theme) -> Self {
        match theme {
            Theme::Dark => DARK,
            Theme::Light => LIGHT,
        }
    }

    /// Returns the background of a control, by its state.
    pub fn fill(&self, chosen: bool, hovered: bool) -> Color32 {
        match (chosen, hovered) {
            (true, _) => self.accent,
            (false, true) => self.hover,
            (false, false) => self.field,
        }
    }

    /// Returns the text colour for that background; dimmed if it cannot be selected.
    pub fn text_on_fill(&self, chosen: bool, possible: bool) -> Color32 {
        match (chosen, possible) {
            (true, _) => self.on_accent,
            (false, true) => self.text,
            (false, false) => self.weak.gamma_multiply(0.6),
        }
    }

    /// Returns the colours of the active theme.
    pub fn for_ui(ui: &egui::Ui) -> Self {
        Self::for_theme(if ui.visuals().dark_mode { Theme::Dark } else { Theme::Light })
    }
}

/// Returns the font family of headings and selected controls.
pub fn medium_font() -> FontFamily {
    FontFamily::Name("medium".into())
}

/// Installs fonts and styles; call once, before the first pass that draws.
pub fn install(ctx: &Context) {
    ctx.set_fonts(font_definitions());
    for theme in [Theme::Dark, Theme::Light] {
        ctx.set_style_of(theme, create_style(theme));
    }
    // The key bindings change the text scale instead.
    ctx.options_mut(|options| options.zoom_with_keyboard = false);
}

/// Returns the two bundled fonts, replacing egui's.
fn font_definitions() -> FontDefinitions {
    let mut fonts = FontDefinitions::empty();
    let files: [(&str, &[u8]); 2] = [
        ("regular", include_bytes!("../fonts/Roboto-Regular.ttf")),
        ("medium", include_bytes!("../fonts/Roboto-Medium.ttf")),
    ];
    for (name, file) in files {
        fonts.font_data.insert(name.to_owned(), Arc::new(FontData::from_static(file)));
    }
    for (family, name) in
        [(FontFamily::Proportional, "regular"), (FontFamily::Monospace, "regular"), (medium_font(), "medium")]
    {
        fonts.families.insert(family, vec![name.to_owned()]);
    }
    fonts
}

/// Returns text sizes and spacing.
fn create_style(theme: Theme) -> Style {
    let colors = Colors::for_theme(theme);
    let mut style = Style { visuals: create_visuals(theme, &colors), animation_time: 0.12, ..Style::default() };
    style.text_styles = [
        (TextStyle::Heading, FontId::new(16.0, medium_font())),
        (TextStyle::Body, FontId::new(13.5, FontFamily::Proportional)),
        (TextStyle::Button, FontId::new(13.0, FontFamily::Proportional)),
        (TextStyle::Small, FontId::new(12.0, FontFamily::Proportional)),
        (TextStyle::Monospace, FontId::new(13.0, FontFamily::Monospace)),
    ]
    .into();
    let spacing = &mut style.spacing;
    spacing.item_spacing = Vec2::new(6.0, 6.0);
    spacing.button_padding = Vec2::new(9.0, 5.0);
    spacing.interact_size = Vec2::new(32.0, ROW);
    spacing.slider_rail_height = 4.0;
    spacing.icon_width = 16.0;
    spacing.combo_width = WIDTH - 2.0 * PAD;
    spacing.menu_margin = Margin::same(6);
    spacing.window_margin = Margin::same(PAD as i8);
    spacing.scroll = ScrollStyle {
        bar_width: 6.0,
        floating_width: 4.0,
        // Reserves space beside the scroll bar, so that it covers nothing.
        floating_allocated_width: 10.0,
        ..ScrollStyle::floating()
    };
    style.interaction.selectable_labels = false;
    style
}

/// Returns colours and shapes of egui's own widgets.
fn create_visuals(theme: Theme, colors: &Colors) -> Visuals {
    let mut visuals = if theme == Theme::Dark { Visuals::dark() } else { Visuals::light() };
    let radius = CornerRadius::same(7);
    let widget = |fill: Color32, border: Stroke, text: Color32| WidgetVisuals {
        bg_fill: fill,
        weak_bg_fill: fill,
        bg_stroke: border,
        corner_radius: radius,
        fg_stroke: Stroke::new(1.0, text),
        expansion: 0.0,
    };
    visuals.widgets.noninteractive = widget(colors.card, Stroke::new(1.0, colors.line), colors.text);
    visuals.widgets.inactive = widget(colors.field, Stroke::NONE, colors.text);
    visuals.widgets.hovered = widget(colors.hover, Stroke::NONE, colors.text);
    visuals.widgets.active = widget(colors.hover, Stroke::NONE, colors.text);
    visuals.widgets.open = widget(colors.hover, Stroke::NONE, colors.text);
    visuals.selection = Selection { bg_fill: colors.accent, stroke: Stroke::new(1.0, colors.on_accent) };
    visuals.weak_text_color = Some(colors.weak);
    visuals.hyperlink_color = colors.accent;
    visuals.error_fg_color = colors.alarm;
    visuals.warn_fg_color = colors.accent;
    visuals.extreme_bg_color = colors.field;
    visuals.faint_bg_color = colors.field;
    visuals.panel_fill = colors.card;
    visuals.window_fill = to_opaque(colors.card);
    visuals.window_stroke = Stroke::new(1.0, colors.line);
    visuals.window_corner_radius = CornerRadius::same(12);
    visuals.menu_corner_radius = CornerRadius::same(9);
    // Soft shadows need many triangles, which the CPU may have to draw.
    (visuals.window_shadow, visuals.popup_shadow) = (Shadow::NONE, Shadow::NONE);
    visuals.slider_trailing_fill = true;
    visuals.handle_shape = HandleShape::Circle;
    visuals.disabled_alpha = 0.5;
    visuals
}

/// Returns the same colour, fully opaque.
fn to_opaque(color: Color32) -> Color32 {
    let [r, g, b, _] = color.to_srgba_unmultiplied();
    Color32::from_rgb(r, g, b)
}

/// Returns the frame of panel and cards.
pub fn card_frame(colors: &Colors) -> egui::Frame {
    egui::Frame::new()
        .fill(colors.card)
        .stroke(Stroke::new(1.0, colors.line))
        .corner_radius(CornerRadius::same(12))
        .inner_margin(Margin::same(PAD as i8))
}

/// Draws a ring around the visible part of the control that has the keyboard focus.
pub fn draw_focus_ring(ctx: &Context) {
    let focused = ctx.memory(|memory| memory.focused()).and_then(|id| ctx.read_response(id));
    if let Some(response) = focused.filter(|response| response.sense.interactive()) {
        let colors = Colors::for_theme(ctx.theme());
        let seen = response.interact_rect.expand(3.0);
        let painter = ctx.layer_painter(response.layer_id).with_clip_rect(seen);
        painter.rect_stroke(
            response.rect.expand(1.0),
            CornerRadius::same(8),
            Stroke::new(2.0, colors.text),
            StrokeKind::Outside,
        );
    }
}
