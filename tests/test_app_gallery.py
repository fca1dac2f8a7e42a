"""The gallery of a map keeps still under the hand: what did not change is not drawn again."""

from types import SimpleNamespace

from support.page import page, press, run, until, wait_for, write
from underlay.app.pages.many import GalleryPart
from underlay.app.shown import Gallery
from underlay.report.review import Card


class Answers:
    """A window whose process answers with the gallery that it is given, and keeps what is decided."""

    holds = True

    def __init__(self, gallery):
        self.gallery, self.decided = gallery, []
        self.analysis = SimpleNamespace(quick=None)

    async def ask(self, _worker, _task, _page):
        return self.gallery

    async def try_to(self, _worker, _task, names, word, reason):
        self.decided.append((*names, word, reason))


def card(name, **what):
    return Card(name, "good", "", ("1 kPa",), 0.01, "<svg></svg>", fitted=True, **what)


def test_a_gallery_drawn_again_takes_neither_a_button_nor_a_question_away(tmp_path):
    async def person():
        async with page(tmp_path) as user:
            window = Answers(Gallery((card("one"), card("two")), 1))

            async def nothing():
                return None

            with user.client.content:
                part = GalleryPart(window, nothing)
                await part.show()
            before = user.find(marker="refuse-one").elements
            await part.show()
            assert user.find(marker="refuse-one").elements == before
            press(user, "refuse-one")
            await until(user, "reason")
            # Another curve was decided meanwhile, so that the gallery is another.
            window.gallery = Gallery((card("one"), card("two", decision="accept")), 1)
            await part.show()
            await until(user, "decided-two")
            assert user.find(marker="refuse-one").elements != before
            write(user, "reason", "bubble")
            press(user, "refuse-now")
            await wait_for(lambda: window.decided)
            assert window.decided == [("one", "refuse", "bubble")]

    run(person())
