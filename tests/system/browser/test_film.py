"""``make video``: what it writes is a film that a browser plays."""

import base64
from pathlib import Path

from film import SIZE, Film
from playwright.sync_api import Browser

PLAY = """
(film) => new Promise((done) => {
  const video = document.createElement("video");
  const canvas = document.createElement("canvas");
  video.muted = true;
  video.onended = () => {
    [canvas.width, canvas.height] = [video.videoWidth, video.videoHeight];
    const context = canvas.getContext("2d");
    context.drawImage(video, 0, 0);
    const colour = [...context.getImageData(20, 20, 1, 1).data.slice(0, 3)];
    const { videoWidth, videoHeight, currentTime } = video;
    done({ size: [videoWidth, videoHeight], length: currentTime, colour });
  };
  video.src = "data:video/webm;base64," + film;
  video.play();
})
"""


def test_a_film_of_a_page_can_be_played(browser: Browser, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
    page.set_content("<body>A page")
    film = Film(page)
    film.caption("It begins white", 0.6)
    page.evaluate("() => { document.body.style.background = 'rgb(0, 90, 160)'; }")
    film.caption("and ends blue", 1.0)
    path = tmp_path / "film.webm"
    film.save(browser, path)
    played = page.evaluate(PLAY, base64.b64encode(path.read_bytes()).decode())
    assert tuple(played["size"]) == SIZE
    assert played["length"] > 1.0
    red, green, blue = played["colour"]
    assert blue > green > red
    page.close()
