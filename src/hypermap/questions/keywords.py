"""What words mean in every question: keywords, those that say nothing, numbers and units."""

from __future__ import annotations

_KEYWORDS = {
    "WHERE": (
        "where|whereabouts|where can i find|where would i find|where might i find|where do i find"
        "|where can i get|where do you see"
        "|where did you see|where did i put|where did i leave|in which place"
        "|where did you last see|where did i last see|where did we last see"
        "|where have you seen|where have you last seen|where do you keep|where do we keep"
        "|where can you see|where have you put|where is there"
    ),
    "WHAT": (
        "what|what things|what objects|which things|which objects|what all|everything"
        "|what can i find|what do you see|what can you see|what do we have|what have you got"
        "|what do you have|what do you know|what did you see|what have you seen"
    ),
    "WHEN": (
        "what is the last time you saw|when was the last time you saw|the last time you saw"
        "|when did you last see|when did you see|when have you seen|when have you last seen"
        "|when was|when were|when did you notice|when did you last notice"
    ),
    "SEEN": "seen|last seen|has been seen|have been seen|was seen|were seen|been seen",
    "UNSEEN": (
        "have you not seen|did you not see|has not been seen|have not been seen|not been seen"
        "|have not you seen|did not you see|was not seen|were not seen|not seen|unseen"
        "|have not seen"
    ),
    "NEW": "new|added|newly seen|first seen|appeared|was added|were added|has appeared"
    "|has been added|have been added|have appeared",
    "WHICH": "which|what kind of|which of|what are the names of",
    "HOW_MANY": "how many|count|number of|the number of|how much",
    "HOW_FAR": (
        "how far|how far away|how far off|how close|what is the distance|distance"
        "|how many meters|how many metres|how many feet|how many yards|how many centimeters"
        "|how long is the way|how long is the path"
    ),
    "HOW_BIG": (
        "how big|how large|how wide|how long|how tall|how high|how deep|how many square meters"
        "|what size|what is the size of|what are the sizes of|what are the dimensions of|size of"
        "|dimensions of|what is the area of|what is the width of|what is the length of"
        "|what is the height of"
    ),
    "IS": "is|are|was|were|stood|lay|is it|are they|stand|stands|lie|lies|be|exist|exists",
    "THERE": "there",
    "HAVE": (
        "have|has|having|contain|contains|with|do you have|have you got|can you see|do you see"
        "|do we have|have we got|do you know of|did you see|have you seen|containing"
    ),
    "SHOW": (
        "show|show me|list|find|find me|locate|give me|get me|look for|search for|point me to"
        "|i want to find|i want to see|i am trying to find|i have to find|help me find"
        "|i need|i want|i am looking for|i would like|i can not find|i cannot find|i lost"
        "|point out|name|search|can i get a list of|a list of"
        "|give me a list of|make a list of|list of|can i get|can i have|list all of"
    ),
    "THE_MOST": (
        "nearest|closest|farthest|furthest|largest|biggest|smallest|tiniest|tallest|surest"
        "|most certain|newest|most recent|next"
    ),
    "IN": (
        "in|inside|inside of|into|in the area of|belonging to|throughout"
        "|in all|in all the|in all of the"
    ),
    "AT": "at",
    "ON": (
        "on|on top of|upon|lying on|standing on|sitting on|resting on|placed on|on all|on all the"
    ),
    "ON_IT": (
        "on it|on them|on top|on top of it|on top of them|lying on it|lying on them|standing on it"
        "|standing on them|placed on it|placed on them"
    ),
    "UNDER": "under|underneath|below|beneath",
    "NEXT_TO": (
        "near|next to|close to|by|beside|around|nearby|near to|adjacent to|at the side of"
        "|in the vicinity of|alongside|right next to|not far from|touching"
    ),
    "WITHIN": (
        "within|at most|less than|fewer than|not more than|no more than|up to|closer than"
        "|no farther than|in a radius of|within a radius of|in a distance of"
    ),
    "BEYOND": (
        "more than|farther than|further than|at least|beyond|over|no less than|not less than"
        "|no fewer than|not fewer than"
    ),
    "EACH": "each|every|each of|every one of|every single",
    "PER": "per",
    "MOST": "most|largest number of|highest number of|greatest number of",
    "FEWEST": "fewest|least|smallest number of|lowest number of",
    "LACK": (
        "without|without any|with no|has no|have no|lack|lacks|do not have|does not have"
        "|do not have any|does not have any|have not got|has not got|do not contain"
        "|does not contain|contains no|contain no|have neither|has neither|with neither"
        "|contain neither|contains neither"
    ),
    "EXACTLY": "exactly|just|only",
    "OR_MORE": "or more",
    "OR_FEWER": "or fewer|or less",
    "SEVERAL": "several|multiple",
    "SAME_ROOM": "one room|a single room|single room|the same room|same room",
    "IN_ROOM_OF": (
        "in the same room as|in the same room with|in same room as|in the room of|in one room with"
        "|in a room with|sharing a room with|in the room with"
    ),
    "NEXT_DOOR": (
        "connected to|connected with|connected directly to|directly connected to|next door to"
        "|linked to|joined to|connects to|connect to|opens to|open to|opens into|open into"
        "|leads to|lead to|adjoining|adjoin|adjoins"
    ),
    "SIDE": (
        "left of|to the left of|on the left of|right of|to the right of|on the right of"
        "|in front of|behind|at the back of|left from|right from|on the left side of"
        "|on the right side of"
    ),
    "MY_SIDE": (
        "on my left|to my left|on your left|to your left|on my right|to my right|on your right"
        "|to your right|ahead|ahead of me|ahead of you|straight ahead|right in front of me"
        "|directly in front of me|in my back|behind my back"
    ),
    "NOT": "not|not one|outside|outside of|anywhere but|except those|except the ones|but not those",
    "AND": "and|and also|and are|and is|but|as well as|that are also|plus",
    "OR": "or|and or|nor",
    "OF": "of",
    "FROM": "from|away from|off",
    "TO": "to",
    "BETWEEN": "between|in between",
    "ME": "me|you|us|where i am|my position|the robot|yourself|where you are",
    "PLACE_HERE": "here|this place",
    "IN_HERE": (
        "in here|in this room|inside this room|in the room where i am|in the room i am in"
        "|in the same room as me|in the current room"
    ),
    "THIS_ROOM": (
        "this room|my room|our room|the current room|the room i am in|the room where i am"
    ),
    "WHERE_AM_I": (
        "which room am i in|what room am i in|in which room am i|in what room am i|where am i"
        "|which room are you in|what room are you in|in which room are you|where are you"
        "|which room is this|what room is this"
    ),
    "WHAT_SEEN_FROM": (
        "what can you see from|what do you see from|what can i see from|what could you see from"
    ),
    "TAG": "tagged|tagged as|tagged with|with tag|with the tag|that have the tag|have the tag",
    "HERE": "around here|near here|close by|in the vicinity|near by",
    "VISIBLE": "visible from|in sight of|within sight of|in view of|can be seen from|seen from",
    "BY_PATH": (
        "by path|on foot|walking|to walk|by walking|driving|to drive|along the path|by road"
        "|by driving"
    ),
    "ROOM": "room|rooms|places|room names",
    "WHO": "who",
    "DO": "does|do",
    "SURE": (
        "are you most sure of|are you surest of|are you most certain of|is most certain"
        "|is the most certain|are most certain|is the surest"
    ),
    "BUT": (
        "except|besides|except for|apart from|other than|but not|but no|and no|that is no|excluding"
    ),
}
OF_CONDITIONS = {
    "VISIBLE",
    "IN",
    "AT",
    "ON",
    "UNDER",
    "NEXT_TO",
    "WITHIN",
    "BEYOND",
    "SIDE",
    "IN_ROOM_OF",
    "NOT",
    "IS",
}
"""The tokens with which conditions begin."""
PLACED = OF_CONDITIONS - {"NOT", "IS"}
"""Those of conditions on where something is."""
NOT_THOSE = ("but not", "but not those", "except those", "except the ones")
"""What these words leave out is of the first objects, not of those near which they are."""
_DROPPED = (
    "please|the|a|an|my|our|your|his|her|their|its|some|any|all|all the|robot"
    "|hey|hi|hello|ok|okay|can you tell me|could you tell me|do you know|tell me|actually"
    "|now|right now|currently|in this map|on this map|on the map|in the map"
    "|in this building|in the building|in the house|in the world|that is|that are|which is"
    "|which are|that|s|kind of|also|then|so|can you|could you|would you|will you"
    "|i wonder|thanks|thank you|quickly|approximately|roughly|altogether"
    "|in total|you know of|you can see|you see|you know|we have|you have|there are|located"
    "|do you happen to know"
    "|situated|standing|lying|available|placed|ones|anywhere|somewhere|else|all of"
    "|does the house|does this house|does the building"
    "|does this building|does the map|does the flat|does this floor|in the flat"
    "|in this house|in this flat|of them|have to be|one that|other|whole|entire|it|this"
    "|on this floor|in our house|in my house|in our building|in our flat|in my flat"
    "|me know|let me know|stored|still|in them|in there|both"
)
_NUMBER_WORDS = (
    "zero|one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|thirteen|fourteen|fifteen"
    "|sixteen|seventeen|eighteen|nineteen|twenty"
)
_ORDINAL_WORDS = "second|third|fourth|fifth|sixth|seventh|eighth|ninth|tenth"
ORDINALS = {word: rank for rank, word in enumerate(_ORDINAL_WORDS.split("|"), start=2)}
ORDINALS |= {"2nd": 2, "3rd": 3} | {f"{rank}th": rank for rank in range(4, 11)}
"""The ranks that words as in "second nearest" mean."""
PARTS = {"half a": 0.5, "half": 0.5, "a half": 0.5, "a quarter of a": 0.25, "one and a half": 1.5}
"""The numbers that are not whole."""
_UNITS = {
    1.0: "m|meter|meters|metre|metres",
    0.01: "cm|centimeter|centimeters|centimetre|centimetres",
    0.001: "mm|millimeter|millimeters|millimetre|millimetres",
    1000.0: "km|kilometer|kilometers|kilometre|kilometres",
    0.3048: "ft|foot|feet",
    0.0254: "inch|inches",
    0.9144: "yard|yards|yd",
}
PHRASES: dict[str, str] = {
    phrase: token for token, phrases in _KEYWORDS.items() for phrase in reversed(phrases.split("|"))
}
PHRASES |= {
    f"{ordinal} {most}": "THE_MOST"
    for ordinal in ORDINALS
    for most in _KEYWORDS["THE_MOST"].split("|")
}
PHRASES |= dict.fromkeys(_DROPPED.split("|"), "")
"""The token of each keyword; empty for one that says nothing."""
KEYWORDS = tuple(phrase for phrase in PHRASES if len(phrase) > 3)
"""Words and phrases with a meaning in all questions, of which people mistype."""
NUMBER_OF = {word: number for number, word in enumerate(_NUMBER_WORDS.split("|"))}
"""The whole numbers."""
UNIT_OF = {unit: meters for meters, units in _UNITS.items() for unit in units.split("|")}
"""The length of each unit [m]."""


def is_reserved(phrase: str) -> bool:
    """Return whether all words of a phrase are keywords, units or numbers, or without a letter."""
    return all(
        not any(map(str.isalpha, word))
        or any(word in words for words in (PHRASES, UNIT_OF, NUMBER_OF))
        for word in phrase.split()
    )


def meters_of(number: str, unit: str) -> float:
    """Return a length [m], of a number in digits and a unit of `UNIT_OF`."""
    return round(float(number) * UNIT_OF[unit], 6)
