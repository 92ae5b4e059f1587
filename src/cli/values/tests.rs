use super::*;
use crate::bokeh::Rank;
use crate::depth::focus::FocusRule;
use crate::look::Tilt;

#[test]
fn wrong_values_say_what_is_accepted() {
    for text in ["0", "-1", "inf", "0.5", "far", "0.5,1.1", "0.5,", "1,1,1"] {
        let accepted = text.parse::<FocusRule>();
        assert_eq!(accepted.is_ok(), text == "0.5", "{text}: {accepted:?}");
    }
    for text in ["640", "0x480", "640x", "99999x1"] {
        assert!(text.parse::<Size>().unwrap_err().contains("1280x720"), "{text}");
    }
    for text in ["0", "17", "all"] {
        assert!(text.parse::<Rank>().unwrap_err().contains("1 to 16"), "{text}");
    }
    assert!("0.5:0.1:0:0".parse::<Tilt>().is_err());
    assert_eq!("0.6".parse(), Ok(Tilt { center_y: 0.6, band: 0.15, angle_deg: 0.0 }));
}
